"""The host of a run's session: it records the measurements and asks the observer the questions of the procedure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from drivers.recorder import Samples
from procedures.questions import Question
from procedures.session import Dwell, Guidance, Pose, Reading, RecordedPose
from rig.errors import RunMismatch
from rig.instruments.instruments import Rig
from rig.instruments.person import answer, follow
from rig.record import KeptPose, Record, Run
from rig.record.history import ANSWER, QUESTION
from rig.record.measured import MeasuredRun, of_sensor
from rig.runs.observer import Observer
from rig.runs.stuck import StuckOutputs


def leave_as(rig: Rig, record: Record, run: str) -> None:
    """Restore a simulated `rig` to the end of `run`: at rest, the oven off, the sensor face up.

    A real rig is in this state already.
    """
    state = record.state(run)
    if state is None or rig.world is None:
        return
    rig.restore(state["rig"])
    rig.stop()
    if any(reading.value for reading in record.readings(run) if reading.name in ("mount", "flip")):
        rig.world.advance(max(rig.clock.now(), rig.world.now_s))
        rig.world.mount_sensor()


SENSOR = "digital sensor"  # event: samples of a digital sensor were lost, doubled or damaged
LOSSES = {  # counts of a digital sensor, in words
    "samples-lost": "lost",
    "samples-doubled": "doubled",
    "lines-damaged": "damaged",
    "messages-damaged": "damaged",
    "sensor-restarts": "restarts",
}


class RunHost:
    """The host of a session that records the measurements."""

    def __init__(self, record: Record, rig: Rig, run: Run, observer: Observer, state: Mapping[str, Any] | None) -> None:
        self._record, self._rig, self._run, self._observer = record, rig, run.run, observer
        self._poses = record.poses(run.run)
        self._next = record.next_number(run.run)
        self._measured = MeasuredRun(record, run, rig.bench.first_sensor)
        self._dwells: list[Dwell] | None = None  # read from the record if the procedure needs them
        self._answers = {e.what: e.text for e in record.events(run.run) if e.what.startswith(ANSWER)}
        self._zero_s = state["zero_s"] if state else _zero_s(rig, run)
        self._counted: dict[str, tuple[float, str]] = {}
        self._readings: Sequence[Reading] | None = record.readings(run.run)
        self._before = {reading.name: reading.value for reading in self._readings}
        self._outputs, self._rate_hz = StuckOutputs(run.kind), math.inf
        self._outputs.recall((dwell for _, dwell in record.dwells(run.run)), self._zero_s)
        if state is None:  # a restored clock is right
            _require_rising_time(rig.clock.now() - self._zero_s, record, run)

    def kept(self) -> Sequence[Pose]:
        return self._poses

    def measured(self) -> Sequence[Dwell]:
        if self._dwells is None:
            self._dwells = [recorded.dwell for recorded in self._measured.kept()]
        return self._dwells

    def recorded(self) -> Sequence[RecordedPose]:
        return list(self._measured.kept())

    def readings(self) -> Sequence[Reading]:
        if self._readings is None:
            self._readings = self._record.readings(self._run)
        return self._readings

    def expect(self, missing: int) -> None:
        self._observer.expect(missing + len(self._poses), len(self._poses))

    def keep(self, pose: Pose, samples: Samples, temperature_c: float | None) -> None:
        self._rate_hz = samples.rate_hz
        self._outputs.require_alive(pose, samples)
        middle_s = samples.start_s + len(samples.volts) / samples.rate_hz / 2
        dials = self._rig.read_deg()
        recorded = KeptPose(
            pose,
            samples,
            middle_s - self._zero_s,
            temperature_c,
            alpha_read_deg=dials.get("alpha"),
            beta_read_deg=dials.get("beta"),
        )
        state = self._state()
        self._log("kept", f"pose {self._next}: {len(samples.volts)} samples{self._losses()}")
        self._record.keep(self._run, self._next, recorded, state)
        self._next += 1
        self._poses.append(pose)
        if self._dwells is not None:
            self._dwells.append(of_sensor(recorded, self._measured.sensor).dwell)
        self._observer.kept(recorded)

    def exclude_since(self, since_s: float, reason: str) -> None:
        """Exclude the poses with samples from `since_s` of the clock on: a resumed run measures them again."""
        t_s = since_s - self._zero_s
        spoilt = [
            number for number, dwell in self._record.dwells(self._run) if dwell.t_s + dwell.n / self._rate_hz / 2 >= t_s
        ]
        self._record.exclude(self._run, spoilt, reason)

    def keep_readings(self, *readings: Reading) -> None:
        for reading in readings:
            self._log("read", f"{reading.name} = {reading.value:g} {reading.unit}".rstrip())
        self._record.keep_readings(self._run, readings, self._state())
        self._readings = None
        for reading in readings:
            self._observer.read(reading)

    def _losses(self) -> str:
        """Samples that a digital sensor has lost, doubled or damaged since the last pose, in words."""
        counted_before, self._counted = self._counted, self._rig.tally()
        zero = (0.0, "")
        new = {name: self._counted.get(name, zero)[0] - counted_before.get(name, zero)[0] for name in LOSSES}
        return "".join(f", {LOSSES[name]} {count:.0f}" for name, count in new.items() if count)

    def keep_tally(self) -> None:
        """Record what a digital sensor has counted, at the end of a run or of a part of it."""
        tally = self._rig.tally()
        if not tally:
            return
        counters = [name for name, (_, unit) in tally.items() if not unit]
        total = {name: tally[name][0] + self._before.get(name, 0.0) for name in counters}
        readings = [Reading(name, total.get(name, value), unit) for name, (value, unit) in tally.items()]
        self._record.keep_readings(self._run, readings, None)
        self._readings = None
        losses = {words: total[name] for name, words in LOSSES.items() if name in total}
        if any(losses.values()):
            losses_text = ", ".join(f"{words} {count:.0f}" for words, count in losses.items())
            self._record.note(self._run, SENSOR, f"of {total['samples']:.0f} samples: {losses_text}")

    def keep_state(self) -> None:
        """Record the state of the bench before the first measurement."""
        if (state := self._state()) is not None:
            self._record.keep_state(self._run, state)

    def ask(self, question: Question) -> str:
        key = f"{ANSWER}{question.name}"
        if key in self._answers and not question.repeated:
            return self._answers[key]
        reply = question.checked(self._observer.ask(question, answer(question, self._rig)))
        if reply != "no":  # a resumed run asks again after a no
            self._answers[key] = reply
            self._record.note(self._run, key, reply)
        self._log(QUESTION, f"{question.name}: {question.text}")
        self._log("asked", f"{question.name}: {reply}")
        return reply

    def doing(self, text: str) -> None:
        self._log("doing", text)
        self._observer.doing(text)

    def guide(self, guidance: Guidance) -> None:
        self._log("guided", guidance.text)
        follow(guidance, self._rig)
        self._observer.guide(guidance)

    def _log(self, event: str, text: str) -> None:
        self._record.log(self._run, self._rig.clock.now(), "run", event, text)

    def _state(self) -> dict[str, Any] | None:
        """The state to record with a pose. Raises the error of a stage that has left its position."""
        self._rig.require_steady()
        rig = self._rig.state()
        return None if rig is None else {"rig": rig, "zero_s": self._zero_s}


def _zero_s(rig: Rig, run: Run) -> float:
    """The clock's time at t = 0: the time of power-on or, if unknown, the start of the run."""
    powered_s = rig.power_on_s()
    if powered_s is not None:
        return powered_s
    age = datetime.now(UTC) - datetime.fromisoformat(run.created)
    return rig.clock.now() - age.total_seconds()


def _require_rising_time(t_s: float, record: Record, run: Run) -> None:
    """Raises RunMismatch if the computer's clock was set back between two parts of a run.

    Within one part of a run a change of the computer's clock has no effect.
    """
    last_s = record.last_t_s(run.run)
    if last_s is not None and t_s < last_s:
        raise RunMismatch(
            f"by the computer's clock the run began {t_s:.0f} s ago, but its last pose was at {last_s:.0f} s; "
            "correct the clock, then resume the run"
        )
