"""Runs a procedure on a bench into the record, and goes on with one that was interrupted.

A procedure is a function of its settings and of what the record holds, so there is one way to resume whatever the
interruption was: run it again over the poses that are missing. On a simulated bench the state after each pose is
committed with it, so that a resumed run equals an undisturbed one bit for bit.

Whoever looks on may have an interrupted run go on at once. That is the same way: everything is let go, then resumed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any, Literal, Protocol

from drivers.errors import DriverError, Interlocked
from procedures.catalogue import Procedure, find
from procedures.errors import Declined, NoAnswer, ProcedureError, SafetyLimit
from procedures.questions import Question
from procedures.session import Dwell, Pose, Reading, Samples
from procedures.settings import parse
from rig.bench import Bench
from rig.certificates import EXPIRED, expired
from rig.errors import RigError, RunMismatch, Stopped
from rig.instruments import Rig, connected
from rig.lease import lease
from rig.onward import leave_as
from rig.plan import Plan, plan
from rig.record import Kept, Record, Run
from rig.record.measured import Measured, of_sensor
from rig.results import Result, documents, judged, returned
from rig.signals import stoppable
from rig.technician import answer

Wish = Literal["resume", "repeat", "end"]
REPEATED = "repeated by hand"


class Watch(Protocol):
    """Who looks on: a terminal, a test, nobody."""

    def planned(self, plan: Plan) -> None:
        """All that a new run will do, before it begins. Raises Declined where a person does not want it."""

    def begun(self, run: str) -> None: ...
    def doing(self, text: str) -> None: ...
    def expect(self, total: int, done: int) -> None: ...
    def kept(self, kept: Kept) -> None: ...
    def read(self, reading: Reading) -> None: ...

    def ask(self, question: Question, instead: str | None) -> str:
        """A person's checked answer, or `instead` of one where nobody looks on. Raises NoAnswer where there is none."""

    def interrupted(self, outcome: Outcome) -> Wish:
        """The run does not go on and all stands still: resume it, repeat its last pose and go on, or end it."""


@dataclass(frozen=True)
class Outcome:
    """How a run ended: complete, stopped or failed; `error` says why it is not complete.

    `moving` names what could not be stopped.
    """

    run: Run
    error: Exception | None = None
    moving: tuple[str, ...] = ()


def start(
    record: Record,
    bench: Bench,
    procedure: Procedure,
    settings: Mapping[str, Any],
    watch: Watch,
    after: str | None = None,
) -> Outcome:
    """Run `procedure` from the beginning. Whatever is wrong before its first move leaves the record untouched.

    A simulated bench begins anew, or goes on from where the run `after` left it, as a real one always does.

    Raises the errors of settings, plan and connection, Declined; an error of the run itself is in the outcome.
    """
    planned = plan(bench, procedure, settings)  # every move within its limits, or an error here
    with stoppable():
        watch.planned(planned)
        return _as_wished(record, _begun(record, bench, procedure, settings, watch, after), watch)


def _begun(
    record: Record, bench: Bench, procedure: Procedure, settings: Mapping[str, Any], watch: Watch, after: str | None
) -> Outcome:
    with stoppable(), connected(bench) as rig:
        identities = {role: asdict(identity) for role, identity in rig.identities().items()}
        faults = expired(bench, datetime.now(UTC).date())
        run = record.begin(
            procedure.name,
            _plain(settings),
            bench=bench.document(),
            configuration=bench.configuration(procedure.name, _plain(settings)),
            constants=bench.constants | ({EXPIRED: "; ".join(faults)} if faults else {}),
            source=bench.name,
            identities=identities,
            kind=procedure.kind,
        )
        for fault in faults:
            record.note(run, EXPIRED, fault)
        if after is not None:
            leave_as(rig, record, after)
        with _held(record, run):
            return _carry_out(record, rig, record.run(run), procedure, watch)


def resume(record: Record, run_id: str, watch: Watch, bench: Bench | None = None) -> Outcome:
    """Go on with a run at its first missing pose, on the bench that it was begun with.

    Raises Busy, RunMismatch where `bench` or an instrument is another one, and the errors of connection.
    """
    with stoppable():
        return _as_wished(record, _resumed(record, run_id, watch, bench), watch)


def _resumed(record: Record, run_id: str, watch: Watch, bench: Bench | None = None) -> Outcome:
    run = record.run(run_id)
    if run.state == "complete":
        return Outcome(run)
    if bench is not None and bench.configuration(run.procedure, run.settings) != run.configuration:
        raise RunMismatch(f"run {run_id} was begun with another bench; resume it without --bench, or with that file")
    own = bench or Bench.model_validate(run.bench)  # the same, but for faults that have been repaired
    procedure = find(run.procedure, own.folders.procedures)
    with stoppable(), _held(record, run_id), connected(own) as rig:
        _same_instruments(run, rig)
        return _carry_out(record, rig, run, procedure, watch)


def _as_wished(record: Record, outcome: Outcome, watch: Watch) -> Outcome:
    """An interrupted run goes on for as long as who looks on wants it to."""
    while outcome.error is not None and (wish := _wish(outcome, watch)) != "end":
        run = outcome.run.run
        if wish == "repeat" and outcome.run.rows:
            record.exclude(run, record.next_number(run) - 1, REPEATED)
        try:
            outcome = _resumed(record, run, watch)
        except (DriverError, RigError) as error:  # such as an instrument that still does not answer
            outcome = Outcome(record.run(run), error)
    return outcome


def _wish(outcome: Outcome, watch: Watch) -> Wish:
    """A person's wish. A signal that is none of theirs ends the run, as does any signal while they are asked."""
    if isinstance(outcome.error, Stopped) and outcome.error.by != "SIGINT":
        return "end"
    try:
        with stoppable():
            return watch.interrupted(outcome)
    except KeyboardInterrupt:
        return "end"


def _held(record: Record, run: str) -> AbstractContextManager[None]:
    return lease(record.folder, run, f"run {run}")


def _carry_out(record: Record, rig: Rig, run: Run, procedure: Procedure, watch: Watch) -> Outcome:
    """The run itself; however it ends, the stages stand still and the record says how."""
    record.set_state(run.run, "running")
    watch.begun(run.run)
    try:
        own = _perform(record, rig, run, procedure, watch)
        results, why = (documents(own, rig.bench.result_limits), None) if own else judged(record, run)
    except BaseException as failure:
        complaints = _stop(rig)
        error = _told(failure, run)
        for complaint in complaints:
            record.note(run.run, "not stopped", complaint)
        record.set_state(run.run, _state(error), str(error))
        if isinstance(failure, Exception) and error is not failure:
            raise  # a fault of the program is not the run's
        return Outcome(record.run(run.run), error, tuple(complaints))
    record.set_state(run.run, "complete", why and f"results: {why}", results)
    return Outcome(record.run(run.run))


def _told(failure: BaseException, run: Run) -> Exception:
    """What ended a run, as one message."""
    if isinstance(failure, (DriverError, ProcedureError, RigError)):
        return failure
    if isinstance(failure, KeyboardInterrupt):
        by = str(failure) or "SIGINT"
        return Stopped(f"stopped by {by}; `rig resume {run.run}` goes on where it was", by)
    return RuntimeError(f"{type(failure).__name__}: {failure}")


def _perform(record: Record, rig: Rig, run: Run, procedure: Procedure, watch: Watch) -> Mapping[str, Result]:
    """The procedure on the bench as the record last saw it; the results that it returns itself."""
    state = record.state(run.run)
    host = RunHost(record, rig, run, watch, state)
    session = rig.session(host)
    settings = parse(procedure, run.settings)
    rig.look()
    if state is not None:
        rig.restore(state["rig"])
    with rig.guarded(session):
        if state is None:
            session.reference()
            host.keep_state()
        results = procedure.function(session, **settings) or {}
    return {name: returned(name, result) for name, result in results.items()}


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
        self._record.keep(self._run, self._next, kept, self._state())
        self._next += 1
        self._poses.append(pose)
        if self._dwells is not None:
            self._dwells.append(of_sensor(kept, self._measured.sensor).dwell)
        self._watch.kept(kept)

    def keep_readings(self, *readings: Reading) -> None:
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
        return given

    def doing(self, text: str) -> None:
        self._watch.doing(text)

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


def _same_instruments(run: Run, rig: Rig) -> None:
    """Raises RunMismatch for an instrument that is not the one of the run's beginning."""
    for role, identity in rig.identities().items():
        if asdict(identity) != run.identities.get(role):
            raise RunMismatch(
                f"{role} is now {identity}, the run began with {run.identities.get(role)}; exchange it back"
            )


def _stop(rig: Rig) -> list[str]:
    """Bring the stages to rest before anything else; what does not obey."""
    try:
        return rig.stop()
    except KeyboardInterrupt:
        return ["a second signal came while the stages were being stopped"]


def _state(error: Exception) -> str:
    return "stopped" if isinstance(error, (Stopped, SafetyLimit, Interlocked, NoAnswer, Declined)) else "failed"


def _plain(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as JSON has them, so that those of a resumed run have the same hash."""
    return {name: list(value) if isinstance(value, tuple) else value for name, value in settings.items()}
