"""Runs a procedure on a bench, records it, and resumes it after an interruption.

A procedure is a function of its settings and of the record, so there is one way to resume it after any interruption:
run it again over the missing poses. On a simulated bench the state after each pose is committed with it, so a resumed
run is equal to an undisturbed run, bit for bit.

An observer may continue an interrupted run at once. This is the same: all instruments are released, then connected
again.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import asdict, replace
from datetime import UTC, datetime
from typing import Any

from drivers.errors import DriverError, SensorFault
from procedures.catalogue import Procedure, find
from procedures.errors import ProcedureError
from procedures.questions import Confirm
from procedures.settings import parse
from rig.bench import Bench
from rig.bench.certificates import EXPIRED, find_expired
from rig.errors import RecordError, RigError, RunMismatch, Stopped
from rig.files import program
from rig.instruments.instruments import Rig, connect_all
from rig.lease import lease
from rig.planning.plan import plan
from rig.planning.preparation import first_question
from rig.record import Record, Run
from rig.record.history import ANSWER, STOPS
from rig.record.values import CHANGED
from rig.results import Result, documents, judge_results, read_returned
from rig.runs.host import RunHost, leave_as
from rig.runs.observer import Decision, Observer, Outcome
from rig.runs.signals import Trace, stoppable

__all__ = ["REPEATED", "Decision", "Observer", "Outcome", "RunHost", "resume", "start"]

REPEATED = "repeated by hand"
PROGRAM = "program"  # kind of the log's lines with the version of the program and the digest of the procedure


def start(
    record: Record,
    bench: Bench,
    procedure: Procedure,
    settings: Mapping[str, Any],
    observer: Observer,
    after_run: str | None = None,
    trace: bool = False,
) -> Outcome:
    """Run `procedure` from the beginning. An error before its first move does not change the record.

    With `trace`, the log of the run has every message to and from instruments. A simulated bench begins in its initial
    state, or in the state at the end of the run `after_run`.

    Raises the errors of settings, plan and connection, and Declined. An error of the run itself is in the outcome.
    """
    planned = plan(bench, procedure, settings)  # raises an error for a move outside the limits
    with stoppable():
        observer.planned(planned)
        trail = Trace(record) if trace else None
        first = first_question(planned)
        started_run = _begin_run(record, bench, procedure, settings, observer, after_run, trail, first)
        return _after_decision(record, started_run, observer, trace)


def _begin_run(
    record: Record,
    bench: Bench,
    procedure: Procedure,
    settings: Mapping[str, Any],
    observer: Observer,
    after_run: str | None,
    trace: Trace | None,
    first: Confirm | None,
) -> Outcome:
    with stoppable(inner=True), connect_all(bench, trace) as rig:
        identities = {role: asdict(identity) for role, identity in rig.identities().items()}
        faults = find_expired(bench, datetime.now(UTC).date())
        run = record.begin(
            procedure.name,
            _as_json(settings),
            bench=bench.document(),
            configuration=bench.configuration(procedure.name, _as_json(settings)),
            constants=bench.constants | ({EXPIRED: "; ".join(faults)} if faults else {}),
            source=bench.name,
            identities=identities,
            kind=procedure.kind,
        )
        if trace is not None:
            trace.begin(run)
        for fault in faults:
            record.note(run, EXPIRED, fault)
        if after_run is not None:
            leave_as(rig, record, after_run)
        with _lease_run(record, run):
            return _carry_out(record, rig, record.run(run), procedure, observer, first)


def resume(record: Record, run_id: str, observer: Observer, bench: Bench | None = None, trace: bool = False) -> Outcome:
    """Continue a run at its first missing pose, on the same bench.

    Raises Busy, RunMismatch if `bench` or an instrument is another one, and the errors of connection.
    """
    with stoppable():
        return _after_decision(record, _resume(record, run_id, observer, bench, trace), observer, trace)


def _resume(
    record: Record, run_id: str, observer: Observer, bench: Bench | None = None, trace: bool = False
) -> Outcome:
    run = record.run(run_id)
    if run.state == "complete":
        return Outcome(run)
    if bench is not None and bench.configuration(run.procedure, run.settings) != run.configuration:
        raise RunMismatch(f"run {run_id} began with another bench; resume it without --bench, or with the same file")
    own_bench = bench or Bench.model_validate(run.bench)  # the same, except for repaired faults
    procedure = find(run.procedure, own_bench.folders.procedures)
    trail = Trace(record) if trace else None
    with stoppable(inner=True), _lease_run(record, run_id), connect_all(own_bench, trail) as rig:
        if trail is not None:
            trail.begin(run_id)
        _require_same_instruments(run, rig)
        return _carry_out(
            record, rig, run, procedure, observer, _find_unanswered_question(record, run, own_bench, procedure)
        )


def _find_unanswered_question(record: Record, run: Run, bench: Bench, procedure: Procedure) -> Confirm | None:
    """The first question of a run that ended before its answer; None if the record has an answer."""
    if any(event.what.startswith(ANSWER) for event in record.events(run.run)):
        return None
    return first_question(plan(bench, procedure, parse(procedure, run.settings)))


def _after_decision(record: Record, outcome: Outcome, observer: Observer, trace: bool) -> Outcome:
    """Continue an interrupted run as long as the observer chooses this."""
    while outcome.error is not None and (wish := _decision(outcome, observer)) != "end":
        run = outcome.run.run
        try:
            if wish == "repeat" and outcome.run.rows:
                record.exclude(run, [record.next_number(run) - 1], REPEATED)
            outcome = _resume(record, run, observer, trace=trace)
        except (DriverError, RigError) as error:  # such as an instrument that still does not answer
            outcome = Outcome(record.run(run), error, outcome.moving, retried=True)  # nothing has stopped these since
        except KeyboardInterrupt as stop:  # before the run went on
            outcome = Outcome(record.run(run), _error_of(stop, outcome.run, observer), outcome.moving)
    return outcome


def _decision(outcome: Outcome, observer: Observer) -> Decision:
    """The decision of a person. SIGTERM and SIGHUP end the run, and every signal during the question does."""
    if isinstance(outcome.error, Stopped) and outcome.error.by != "SIGINT":
        return "end"
    try:
        with stoppable(observer.ignored_when_paused):
            return observer.interrupted(outcome)
    except KeyboardInterrupt:
        return "end"


def _lease_run(record: Record, run: str) -> AbstractContextManager[None]:
    return lease(record.folder, run, f"run {run}")


def _carry_out(
    record: Record, rig: Rig, run: Run, procedure: Procedure, observer: Observer, first: Confirm | None
) -> Outcome:
    """The run itself. At its end, also after an error, the stages are at rest, and the record has its state."""

    def log(event: str, text: str) -> None:
        record.log(run.run, rig.clock.now(), "run", event, text)

    log("begun", ", ".join(filter(None, (f"{procedure.name} at pose {run.rows}", observer.place))))
    _note_program(record, run, procedure, log)
    record.set_state(run.run, "running")
    try:
        observer.begun(run.run)  # a person may end it from now on
        own_results = _perform(record, rig, run, procedure, observer, first)
        results, reason = (
            (documents(own_results, rig.bench.result_limits), None) if own_results else judge_results(record, run)
        )
    except BaseException as failure:
        error = _error_of(failure, run, observer)
        log("error", f"{type(error).__name__}: {error}")
        complaints = _stop(rig)
        log("stopped", " ".join(complaints) or "all instruments are at rest")
        with suppress(RecordError):  # the record itself may have failed, and `error` has the reason
            for complaint in complaints:
                record.note(run.run, "not stopped", complaint)
            record.set_state(run.run, _state(error), str(error))
        if isinstance(failure, Exception) and error is not failure:
            raise  # a defect of the program
        return _interrupted_outcome(record, run, error, complaints)
    log("complete", reason or (f"{len(results)} results" if results else ""))
    _complete(record, run.run, reason and f"results: {reason}", results)
    return Outcome(record.run(run.run))


def _note_program(record: Record, run: Run, procedure: Procedure, log: Callable[[str, str], None]) -> None:
    """Log the version of the program and the digest of the procedure. An event marks the change to another one."""
    digest = hashlib.sha256(procedure.path.read_bytes()).hexdigest()[:16]
    present = f"{program()}, procedure {procedure.name} {digest}"
    previous = next((line.text for line in reversed(record.lines(run.run, (PROGRAM,)))), present)
    log(PROGRAM, present)
    if present != previous and run.rows:
        record.note(run.run, CHANGED, f"from pose {run.rows}: {present}; before: {previous}")


def _complete(record: Record, run: str, reason: str | None, results: Mapping[str, Any]) -> None:
    """End a complete run. Its message has the remarks on the record, also on the last transaction."""
    remarks = None
    while remarks != record.remarks:
        remarks = list(record.remarks)
        record.set_state(run, "complete", "; ".join([*([reason] if reason else []), *remarks]) or None, results)


def _interrupted_outcome(record: Record, run: Run, error: Exception, complaints: Sequence[str]) -> Outcome:
    """The outcome of an interrupted run, even if the record cannot be read or written any more."""
    with suppress(RecordError):
        run = record.run(run.run)
    if run.state == "running":  # the record could not take the end
        run = replace(run, state=_state(error), message=str(error))
    return Outcome(run, error, tuple(complaints))


def _error_of(failure: BaseException, run: Run, observer: Observer) -> Exception:
    """The error that ended a run, with one message."""
    if isinstance(failure, (DriverError, ProcedureError, RigError)):
        return failure
    if isinstance(failure, KeyboardInterrupt):
        signal_name = str(failure) or "SIGINT"
        return Stopped(f"{observer.stop_source(signal_name)}; `rig resume {run.run}` continues the run", signal_name)
    return RuntimeError(f"{type(failure).__name__}: {failure}")


def _perform(
    record: Record, rig: Rig, run: Run, procedure: Procedure, observer: Observer, first: Confirm | None
) -> Mapping[str, Result]:
    """Execute the procedure in the last recorded state of the bench. Returns the results of the procedure.

    A person answers `first` before the stages move, also to their home.
    """
    state = record.state(run.run)
    host = RunHost(record, rig, run, observer, state)
    session = rig.session(host)
    settings = parse(procedure, run.settings)
    rig.look()
    for released in rig.release():
        record.log(run.run, rig.clock.now(), "run", "doing", released)
    if state is not None:
        rig.restore(state["rig"])
    try:
        with rig.guarded(session):
            if state is None:
                if first is not None:
                    session.request(first)
                session.reference()
                host.keep_state()
            results = procedure.function(session, **settings) or {}
    except BaseException as failure:
        with suppress(RecordError):  # the record itself may have failed
            if isinstance(failure, SensorFault) and failure.since_s is not None:
                host.exclude_since(failure.since_s, failure.what)
            host.keep_tally()
        raise
    host.keep_tally()
    return {name: read_returned(name, result) for name, result in results.items()}


def _require_same_instruments(run: Run, rig: Rig) -> None:
    """Raises RunMismatch if an instrument was exchanged since the run began."""
    for role, identity in rig.identities().items():
        if asdict(identity) != run.identities.get(role):
            raise RunMismatch(
                f"{role} is now {identity}, but the run began with {run.identities.get(role)}; connect that instrument"
            )


def _stop(rig: Rig) -> list[str]:
    """Stop the stages. Returns a sentence for each instrument that does not stop."""
    try:
        return rig.stop()
    except KeyboardInterrupt:
        return ["a second signal interrupted the stop of the stages; check that they are at rest"]


def _state(error: Exception) -> str:
    return "stopped" if isinstance(error, STOPS) else "failed"


def _as_json(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as in JSON, so that those of a resumed run have the same hash."""
    return {name: list(value) if isinstance(value, tuple) else value for name, value in settings.items()}
