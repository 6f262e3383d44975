"""Control of background runs: start, pause, stop, answer. A run in a terminal publishes its status here as well."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import ParamSpec, Self

from procedures.questions import Question
from procedures.session import Guidance, Reading
from rig.bench import Bench
from rig.errors import Busy, RigError
from rig.files import home
from rig.lease import lease
from rig.planning.plan import Plan
from rig.record import KeptPose, Record
from rig.runs.background.status import (
    KEY_TIME,
    Order,
    Seat,
    Status,
    StatusWriter,
    file,
    folder,
    keys,
    lock,
    mark_stop,
    new_key,
    open_question,
    read,
    remove_old_files,
    stop_source_of,
)
from rig.runs.observer import Decision, Observer, Outcome

P = ParamSpec("P")


class PublishingObserver(Observer):
    """An observer that forwards all events to `observer`, and publishes the status of the run.

    An error of the status file is ignored: it must not disturb the run.
    """

    def __init__(self, observer: Observer, procedure: str, bench: Bench, seat: Seat) -> None:
        self._observer, self._procedure, self.place = observer, procedure, observer.place
        self._key, self._run = new_key(), ""
        self._writer = StatusWriter(self._key, procedure, bench, seat)
        self._held = ExitStack()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._run:
            with suppress(RigError, OSError):
                self._end()
        self._held.close()

    def planned(self, plan: Plan) -> None:
        self._observer.planned(plan)
        self._writer.planned(plan)

    def begun(self, run: str) -> None:
        if not self._run:
            with suppress(RigError, OSError):
                folder().mkdir(parents=True, exist_ok=True)
                remove_old_files()
                self._held.enter_context(lease(home(), lock(self._key), f"an order, {self._procedure}"))
        self._run = run
        self._observer.begun(run)
        self._publish(self._writer.begun, run)

    def doing(self, text: str) -> None:
        self._observer.doing(text)
        self._publish(self._writer.doing, text)

    def guide(self, guidance: Guidance) -> None:
        self._observer.guide(guidance)
        self._publish(self._writer.guide, guidance)

    def expect(self, total: int, recorded_poses: int) -> None:
        self._observer.expect(total, recorded_poses)
        self._publish(self._writer.expect, total, recorded_poses)

    def kept(self, recorded: KeptPose) -> None:
        self._observer.kept(recorded)
        self._publish(self._writer.kept, recorded)

    def read(self, reading: Reading) -> None:
        self._observer.read(reading)
        self._publish(self._writer.read, reading)

    def ask(self, question: Question, instead: str | None) -> str:
        self._publish(self._writer.publish, phase="asking", asked=open_question(question, instead or ""))
        reply = self._observer.ask(question, instead)
        self._publish(self._writer.publish, phase="running", asked=None)
        return reply

    def interrupted(self, outcome: Outcome) -> Decision:
        self._publish(self._writer.publish, phase="paused", error=str(outcome.error), moving=outcome.moving)
        return self._observer.interrupted(outcome)

    def stop_source(self, signal_name: str) -> str:
        return stop_source_of(self._key, signal_name)

    def _publish(self, event: Callable[P, None], *args: P.args, **kwargs: P.kwargs) -> None:
        if self._run:
            with suppress(RigError, OSError):
                event(*args, **kwargs)

    def _end(self) -> None:
        with Record() as record:
            run = record.run(self._run)
        self._writer.ended(run, run.message or "")


# Control of background runs. Every process can control every run.

UNATTENDED = "the run is unattended, so it cannot pause; stop it, and resume it later"
IN_ITS_TERMINAL = "the run began in a terminal; answer there"
_children: list[subprocess.Popen[bytes]] = []  # to collect the processes that have ended


STARTING = "starting"  # the lock of a start: two pages that start at once start one run


def begin(
    procedure: str,
    settings: Mapping[str, str],
    bench_file: Path | None,
    attended: bool,
    sensor: Mapping[str, str] | None = None,
    answers: Mapping[str, str] | None = None,
) -> str:
    """Start `procedure` in the background. Returns its key. Its status has the error, if there is one.

    `sensor` and `answers` are those of `Order`. Raises Busy while another run is in progress.
    """
    order = Order(new_key(), procedure, dict(settings), str(bench_file or ""), attended=attended)
    return _begin(replace(order, sensor=dict(sensor or {}), answers=dict(answers or {})))


def go_on(run: str, procedure: str, bench_file: Path | None, attended: bool) -> str:
    """Resume a run in the background. Returns its key. Raises Busy while another run is in progress."""
    return _begin(Order(new_key(), procedure, {}, str(bench_file or ""), run, attended))


def _begin(order: Order) -> str:
    file(order.key, "log").parent.mkdir(parents=True, exist_ok=True)
    with lease(home(), STARTING, "the start of a run"):
        if (current := latest()) is not None and current.phase != "ended":
            raise Busy(
                f"{current.procedure} is in progress since {begin_time(current)}; stop it, or wait until it ends"
            )
        bench = order.bench().name
        remove_old_files()
        os.mkfifo(file(order.key, "answers"))
        with file(order.key, "log").open("wb") as log:
            words = [sys.executable, "-m", "rig.runs.background.process", order.text()]
            child = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True)  # noqa: S603
        if not file(order.key, "json").exists():  # the process needs a second until its own first status
            Status(order.key, child.pid, order.procedure, bench, run=order.resume).write()
    _children.append(child)
    return order.key


def begin_time(status: Status) -> str:
    """The time of day, local, at which a background run began."""
    start_time = datetime.strptime(status.key.rpartition("-")[0], KEY_TIME).replace(tzinfo=UTC)
    return f"{start_time.astimezone():%H:%M:%S}"


def latest() -> Status | None:
    """The status of the newest background run in progress, else of the newest; None without any."""
    _children[:] = [child for child in _children if child.poll() is None]
    statuses = [status for key in reversed(keys()) if (status := read(key)) is not None]
    return next((status for status in statuses if status.phase != "ended"), statuses[0] if statuses else None)


def pause(status: Status) -> None:
    """Stop the stages at once; the run waits for a decision. Raises RigError for an unattended run."""
    if status.seat == "nobody":
        raise RigError(UNATTENDED)
    _signal(status, signal.SIGINT)


def stop(status: Status) -> None:
    """Stop the stages at once and end the run; `rig resume` can continue it."""
    if status.phase == "paused" and status.seat == "page":
        answer(status, "end")
    else:
        _signal(status, signal.SIGTERM)


def answer(status: Status, text: str) -> None:
    """Answer the question of a run. Raises RigError without a question, or if another process asks."""
    if status.seat == "terminal":
        raise RigError(IN_ITS_TERMINAL)
    if status.asked is None:
        raise RigError("the run has no question; look at its status")
    try:
        pipe = os.open(file(status.key, "answers"), os.O_WRONLY | os.O_NONBLOCK)
    except OSError as error:
        if error.errno == errno.ENXIO:
            raise RigError(f"the run does not wait for an answer to {status.asked.text!r} any more") from None
        raise
    with os.fdopen(pipe, "w", encoding="utf-8") as writer:
        json.dump({"name": status.asked.name, "text": text}, writer)


def _signal(status: Status, number: signal.Signals) -> None:
    if status.phase != "ended":
        mark_stop(status.key, number.name)
        with suppress(ProcessLookupError):
            os.kill(status.pid, number)
