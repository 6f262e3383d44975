"""Runs a procedure on a bench into the record, and goes on with one that was interrupted.

A procedure is a function of its settings and of what the record holds, so there is one way to resume whatever the
interruption was: run it again over the poses that are missing. On a simulated bench the state after each pose is
committed with it, so that a resumed run equals an undisturbed one bit for bit.

Whoever looks on may have an interrupted run go on at once. That is the same way: everything is let go, then resumed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import asdict, replace
from datetime import UTC, datetime
from typing import Any

from drivers.errors import DriverError, Interlocked
from procedures.catalogue import Procedure, find
from procedures.errors import Declined, NoAnswer, ProcedureError, SafetyLimit
from procedures.settings import parse
from rig.bench import Bench
from rig.bench.certificates import EXPIRED, expired
from rig.connected.instruments import Rig, connected
from rig.errors import RecordError, RigError, RunMismatch, Stopped
from rig.lease import lease
from rig.planning.plan import plan
from rig.record import Record, Run
from rig.results import Result, documents, judged, returned
from rig.running.onward import leave_as
from rig.running.run_host import RunHost
from rig.running.signals import stoppable
from rig.running.trace import Trace
from rig.running.watch import Outcome, Watch, Wish

__all__ = ["REPEATED", "Outcome", "RunHost", "Watch", "Wish", "resume", "start"]

REPEATED = "repeated by hand"


def start(
    record: Record,
    bench: Bench,
    procedure: Procedure,
    settings: Mapping[str, Any],
    watch: Watch,
    after: str | None = None,
    trace: bool = False,
) -> Outcome:
    """Run `procedure` from the beginning. Whatever is wrong before its first move leaves the record untouched.

    With `trace`, the run's log has every message to and from instruments.

    A simulated bench begins anew, or goes on from where the run `after` left it, as a real one always does.

    Raises the errors of settings, plan and connection, Declined; an error of the run itself is in the outcome.
    """
    planned = plan(bench, procedure, settings)  # every move within its limits, or an error here
    with stoppable():
        watch.planned(planned)
        trail = Trace(record) if trace else None
        return _as_wished(record, _begun(record, bench, procedure, settings, watch, after, trail), watch, trace)


def _begun(
    record: Record,
    bench: Bench,
    procedure: Procedure,
    settings: Mapping[str, Any],
    watch: Watch,
    after: str | None,
    trace: Trace | None,
) -> Outcome:
    with stoppable(), connected(bench, trace) as rig:
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
        if trace is not None:
            trace.begin(run)
        for fault in faults:
            record.note(run, EXPIRED, fault)
        if after is not None:
            leave_as(rig, record, after)
        with _held(record, run):
            return _carry_out(record, rig, record.run(run), procedure, watch)


def resume(record: Record, run_id: str, watch: Watch, bench: Bench | None = None, trace: bool = False) -> Outcome:
    """Go on with a run at its first missing pose, on the bench that it was begun with.

    Raises Busy, RunMismatch where `bench` or an instrument is another one, and the errors of connection.
    """
    with stoppable():
        return _as_wished(record, _resumed(record, run_id, watch, bench, trace), watch, trace)


def _resumed(record: Record, run_id: str, watch: Watch, bench: Bench | None = None, trace: bool = False) -> Outcome:
    run = record.run(run_id)
    if run.state == "complete":
        return Outcome(run)
    if bench is not None and bench.configuration(run.procedure, run.settings) != run.configuration:
        raise RunMismatch(f"run {run_id} was begun with another bench; resume it without --bench, or with that file")
    own = bench or Bench.model_validate(run.bench)  # the same, but for faults that have been repaired
    procedure = find(run.procedure, own.folders.procedures)
    trail = Trace(record) if trace else None
    with stoppable(), _held(record, run_id), connected(own, trail) as rig:
        if trail is not None:
            trail.begin(run_id)
        _same_instruments(run, rig)
        return _carry_out(record, rig, run, procedure, watch)


def _as_wished(record: Record, outcome: Outcome, watch: Watch, trace: bool) -> Outcome:
    """An interrupted run goes on for as long as who looks on wants it to."""
    while outcome.error is not None and (wish := _wish(outcome, watch)) != "end":
        run = outcome.run.run
        if wish == "repeat" and outcome.run.rows:
            record.exclude(run, record.next_number(run) - 1, REPEATED)
        try:
            outcome = _resumed(record, run, watch, trace=trace)
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

    def log(what: str, text: str) -> None:
        record.log(run.run, rig.clock.now(), "run", what, text)

    log("begun", f"{procedure.name} at pose {run.rows}")
    record.set_state(run.run, "running")
    try:
        watch.begun(run.run)  # a person may end it from now on
        own = _perform(record, rig, run, procedure, watch)
        results, why = (documents(own, rig.bench.result_limits), None) if own else judged(record, run)
    except BaseException as failure:
        error = _told(failure, run)
        log("error", f"{type(error).__name__}: {error}")
        complaints = _stop(rig)
        log("stopped", " ".join(complaints) or "all stands still")
        with suppress(RecordError):  # what has failed may be the record, and that is told already
            for complaint in complaints:
                record.note(run.run, "not stopped", complaint)
            record.set_state(run.run, _state(error), str(error))
        if isinstance(failure, Exception) and error is not failure:
            raise  # a fault of the program is not the run's
        return _interrupted(record, run, error, complaints)
    log("complete", why or f"{len(results)} results")
    record.set_state(run.run, "complete", why and f"results: {why}", results)
    return Outcome(record.run(run.run))


def _interrupted(record: Record, run: Run, error: Exception, complaints: Sequence[str]) -> Outcome:
    """What there is to say of a run that did not end well, even where its record cannot be read any more."""
    try:
        return Outcome(record.run(run.run), error, tuple(complaints))
    except RecordError:
        return Outcome(replace(run, state=_state(error), message=str(error)), error, tuple(complaints))


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
