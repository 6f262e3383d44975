"""The host of a run's session: what a procedure measures goes into the record, what it asks to whoever looks on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from procedures.questions import Question
from procedures.session import Dwell, Pose, Reading, Samples
from rig.connected.instruments import Rig
from rig.connected.technician import answer
from rig.errors import RunMismatch
from rig.record import Kept, Record, Run
from rig.record.measured import Measured, of_sensor
from rig.running.watch import Watch


class RunHost:
    """The session's host that keeps what the procedure measures in the record."""

    def __init__(self, record: Record, rig: Rig, run: Run, watch: Watch, state: Mapping[str, Any] | None) -> None:
        self._record, self._rig, self._run, self._watch = record, rig, run.run, watch
        self._poses = record.poses(run.run)
        self._next = record.next_number(run.run)
        self._measured = Measured(record, run, rig.bench.first_sensor)
        self._dwells: list[Dwell] | None = None  # read from the record only if the procedure asks for them
        self._answers = {e.what: e.text for e in record.events(run.run) if e.what.startswith("answer ")}
        self._zero_s = state["zero_s"] if state else _zero_s(rig, run)
        if state is None:  # else its clock goes on from where it was
            _require_time_goes_on(rig.clock.now() - self._zero_s, record, run)

    def kept(self) -> Sequence[Pose]:
        return self._poses

    def measured(self) -> Sequence[Dwell]:
        if self._dwells is None:
            self._dwells = [kept.dwell for kept in self._measured.kept()]
        return self._dwells

    def readings(self) -> Sequence[Reading]:
        return self._record.readings(self._run)

    def expect(self, missing: int) -> None:
        self._watch.expect(missing + len(self._poses), len(self._poses))

    def keep(self, pose: Pose, samples: Samples, temperature_c: float | None) -> None:
        middle_s = samples.start_s + len(samples.volts) / samples.rate_hz / 2
        dials = self._rig.read_deg()
        kept = Kept(
            pose,
            samples,
            middle_s - self._zero_s,
            temperature_c,
            alpha_read_deg=dials.get("alpha"),
            beta_read_deg=dials.get("beta"),
        )
        state = self._state()
        self._log("kept", f"pose {self._next}: {len(samples.volts)} samples")
        self._record.keep(self._run, self._next, kept, state)
        self._next += 1
        self._poses.append(pose)
        if self._dwells is not None:
            self._dwells.append(of_sensor(kept, self._measured.sensor).dwell)
        self._watch.kept(kept)

    def keep_readings(self, *readings: Reading) -> None:
        for reading in readings:
            self._log("read", f"{reading.name} = {reading.value:g} {reading.unit}".rstrip())
        self._record.keep_readings(self._run, readings, self._state())
        for reading in readings:
            self._watch.read(reading)

    def keep_state(self) -> None:
        """The bench is ready and nothing is measured yet."""
        if (state := self._state()) is not None:
            self._record.keep_state(self._run, state)

    def ask(self, question: Question) -> str:
        key = f"answer {question.name}"
        if key in self._answers and not question.repeated:
            return self._answers[key]
        given = question.checked(self._watch.ask(question, answer(question, self._rig)))
        if given != "no":  # what was refused is asked again when the run goes on
            self._answers[key] = given
            self._record.note(self._run, key, given)
        self._log("asked", f"{question.name}: {given}")
        return given

    def doing(self, text: str) -> None:
        self._log("doing", text)
        self._watch.doing(text)

    def _log(self, what: str, text: str) -> None:
        self._record.log(self._run, self._rig.clock.now(), "run", what, text)

    def _state(self) -> dict[str, Any] | None:
        """What is kept with all that is kept: of a bench that stands as it was told, else it was measured elsewhere."""
        self._rig.require_steady()
        rig = self._rig.state()
        return None if rig is None else {"rig": rig, "zero_s": self._zero_s}


def _zero_s(rig: Rig, run: Run) -> float:
    """The clock's reading at t = 0: when the sensor was powered or, where nobody knows, when the run began."""
    powered_s = rig.power_on_s()
    if powered_s is not None:
        return powered_s
    age = datetime.now(UTC) - datetime.fromisoformat(run.created)
    return rig.clock.now() - age.total_seconds()


def _require_time_goes_on(t_s: float, record: Record, run: Run) -> None:
    """Within a run no step of the computer's clock matters; between two parts of one, a step back would go unnoticed.

    Raises RunMismatch.
    """
    last_s = record.last_t_s(run.run)
    if last_s is not None and t_s < last_s:
        raise RunMismatch(
            f"the computer's clock says that the run is {t_s:.0f} s old, and its last pose was at {last_s:.0f} s; "
            "set the clock right, then resume the run"
        )
