"""The order of a background run (a procedure, or a run to resume), and its status as one small file."""

from __future__ import annotations

import json
import math
import os
import secrets
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from procedures.questions import Choice, Confirm, Question
from rig.bench import Bench, read_bench
from rig.drawings import drawing_of
from rig.errors import RigError
from rig.files import free_bytes, home, write_whole
from rig.lease import is_held
from rig.record import Record, Run
from rig.runs.observer import RunViewer, values
from rig.runs.signals import ON_A_PAGE, stop_source

FOLDER = "apart"
KEY_TIME = "%Y%m%d-%H%M%S-%f"  # start time of a process, UTC


@dataclass(frozen=True)
class Order:
    """`settings` are texts, as on a command line. `resume` is the id of a run, or "" for a new run of `procedure`.

    `attended`: questions go to a person, even if the simulated technician can answer them. `sensor`: name and serial
    number of the mounted sensor, instead of those of the bench file. `answers`: what a person has confirmed already.
    """

    key: str
    procedure: str
    settings: Mapping[str, str] = field(default_factory=dict)
    bench_file: str = ""
    resume: str = ""
    attended: bool = False
    sensor: Mapping[str, str] = field(default_factory=dict)
    answers: Mapping[str, str] = field(default_factory=dict)

    def bench(self) -> Bench:
        """The bench with the sensor of the order, or that of the run to resume. Raises BenchError, RecordError."""
        if self.resume and self.bench_path is None:
            with Record.to_read() as record:
                return Bench.model_validate(record.run(self.resume).bench)
        bench = read_bench(self.bench_path)
        return bench.model_copy(update={"sensor": bench.sensor.model_copy(update=dict(self.sensor))})

    @property
    def bench_path(self) -> Path | None:
        """The bench file; None for the simulated rig."""
        return Path(self.bench_file) if self.bench_file else None

    def text(self) -> str:
        """The order as text for a command line."""
        return json.dumps(asdict(self))

    @staticmethod
    def read(text: str) -> Order:
        """The order from the text of a command line."""
        return Order(**json.loads(text))


def new_key() -> str:
    """A name for a process; names sort by time."""
    return f"{datetime.now(UTC):{KEY_TIME}}-{secrets.token_hex(2)}"


def file(key: str, ending: str) -> Path:
    """One of the files of a process."""
    return home() / FOLDER / f"{key}.{ending}"


# The mark of a stop on a page: a file that is written before the signal, with the name of the signal.


def mark_stop(key: str, signal_name: str) -> None:
    """Mark that a page sends this signal. A full disk must not prevent the stop: then there is no mark."""
    with suppress(RigError, OSError):
        write_whole(file(key, "stop"), signal_name)


def stop_source_of(key: str, signal_name: str) -> str:
    """Who stopped the process `key` by this signal. Removes the mark of a page."""
    mark = file(key, "stop")
    try:
        is_marked = mark.read_text(encoding="utf-8") == (signal_name or "SIGINT")
        mark.unlink()
    except OSError:
        return stop_source(signal_name)
    return ON_A_PAGE if is_marked else stop_source(signal_name)


# The status of a background run, as one small file.

KEPT_ESTIMATES = 20
EVERY_S = 0.5  # real time between two statuses of a simulated run
ATTITUDE = ("alpha_deg", "beta_deg", "mount_deg", "flip")
Phase = Literal["starting", "running", "asking", "paused", "ended"]
Seat = Literal["page", "terminal", "nobody"]


@dataclass(frozen=True)
class OpenQuestion:
    """A question to a person. `proposed`: answer of the simulated technician. `refused`: fault of the last answer.

    `typed`: the last answer, to be corrected. `attitude`: the mounting, for a question about it; keywords of
    `rig.drawings.Attitude`.
    """

    name: str
    text: str
    accepts: str
    choices: Sequence[str] = ()
    proposed: str = ""
    refused: str = ""
    attitude: Mapping[str, Any] | None = None
    typed: str = ""


@dataclass(frozen=True)
class Status:
    """`values` are keywords of `rig.runs.estimates.Value`, with `near`. `state` is the state of the run after its end.

    `seat`: where a person answers: a page, the terminal of the run, or nobody: then it cannot pause. `error`: why it is
    paused or not complete. `moving`: instruments that did not stop. `guidance`: keywords of
    `procedures.session.Guidance`, of a procedure with the sensor in a hand; it has no `attitude`. `attended`: that of
    the order. `extent`: the measurements of a complete run, in words.
    """

    key: str
    pid: int
    procedure: str
    bench: str
    phase: Phase = "starting"
    run: str = ""
    now: str = "starting"
    done: int = 0
    total: int = 0
    left: str = ""
    values: Sequence[Mapping[str, Any]] = ()
    asked: OpenQuestion | None = None
    error: str = ""
    moving: Sequence[str] = ()
    state: str = ""
    attitude: Mapping[str, Any] = field(default_factory=dict)
    seat: Seat = "page"
    guidance: Mapping[str, Any] = field(default_factory=dict)
    attended: bool = False
    extent: str = ""

    def write(self) -> None:
        """Write the status into its file."""
        write_whole(file(self.key, "json"), json.dumps(asdict(self)))


LEAST_FREE = 1 << 18  # bytes; with fewer, a process may have ended without a message
NOT_BEGUN = "it was stopped before the run began"


def read(key: str) -> Status | None:
    """The status of the process `key`; None before its first status. A killed process has ended."""
    status = _read_published(key)
    if status is None or status.phase == "ended" or is_held(home(), lock(key)) or _is_starting(status):
        return status
    status = _read_published(key) or status  # the process may have ended in the meantime
    return status if status.phase == "ended" else _status_of_killed(status)


def _read_published(key: str) -> Status | None:
    """The last status that the process `key` wrote."""
    try:
        document = json.loads(file(key, "json").read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    question = document.pop("asked")
    return Status(**document, asked=OpenQuestion(**question) if question else None)


def _status_of_killed(status: Status) -> Status:
    """The last status of a killed process. The record says how many poses it stored and whether it was complete."""
    error = f"its process ended: {_last_words(status.key, status.run)}"
    status = replace(status, phase="ended", state="stopped", asked=None, error=error)
    if not status.run:
        return status
    with suppress(RigError, OSError):
        with Record.to_find(status.run, local_only=True) as record:
            run = record.run(status.run)
        if run.state == "complete":
            status = replace(status, state=run.state, error="", extent=run.extent)
        done, total = _count_stored(run, status.done, status.total)
        status = replace(status, done=done, total=total)
        status.write()  # later readers need not look into the record
    return status


def _count_stored(run: Run, seen_poses: int, total: int) -> tuple[int, int]:
    """The number of poses of a run that has ended, and of its plan. A signal can come before a stored one is counted.

    A run that is complete before its planned end, because its target is reached, has all its poses.
    """
    stored = max(run.rows, seen_poses) if total else 0
    return stored, stored if run.state == "complete" else total


def _is_starting(status: Status) -> bool:
    """Whether the process exists and has not taken its lock yet."""
    if status.phase != "starting":
        return False
    try:
        os.kill(status.pid, 0)
    except ProcessLookupError:
        return False
    return True


def lock(key: str) -> str:
    """The name of the lock of a running process."""
    return f"{FOLDER}-{key}"


def keys() -> list[str]:
    """All known processes, newest last."""
    return sorted(path.stem for path in folder().glob("*.json"))


def folder() -> Path:
    """The folder of the files."""
    return home() / FOLDER


def remove_old_files() -> None:
    """Remove the files of old processes, except the last KEPT. Their runs stay in the record."""
    for key in keys()[:-KEPT_ESTIMATES]:
        if not is_held(home(), lock(key)):
            for ending in ("answers", "log", "stop", "json"):
                file(key, ending).unlink(missing_ok=True)


def _last_words(key: str, run: str) -> str:
    """The last line of its standard error."""
    path = file(key, "log")
    log = path.read_text(encoding="utf-8", errors="replace").strip() if path.exists() else ""
    if log:
        return log.splitlines()[-1]
    if not run:
        return NOT_BEGUN
    if free_bytes(home()) < LEAST_FREE:
        return "the disk is full; free some space, then `rig resume` continues its run"
    return "it was killed; `rig resume` continues its run"


class StatusWriter(RunViewer):
    """Publishes the events of a run in its status file. `seat`: where a person answers.

    A simulated night has thousands of poses in a minute, so its events are written at most every EVERY_S. The begin,
    questions, interruptions and the end are always written.
    """

    def __init__(self, key: str, procedure: str, bench: Bench, seat: Seat = "page") -> None:
        super().__init__(procedure, bench)
        self._status = Status(key, os.getpid(), procedure, bench.name, seat=seat)
        self._every_s = EVERY_S if bench.simulated else 0.0
        self._written_s = -math.inf

    def publish(self, **changes: Any) -> None:
        """Write the present status."""
        view, self._written_s = self.view, time.monotonic()
        progress, remaining = view.progress, view.left(self._written_s)
        values_now = [{**asdict(value), "near": value.near} for value in values(view)]
        guidance = asdict(view.guidance) if view.guidance else {}
        attitude = {name: getattr(view.kept.pose, name) for name in ATTITUDE} if view.kept and not guidance else {}
        self._status = replace(
            self._status,
            now=view.now,
            done=progress.done,
            total=progress.total,
            left=remaining,
            values=values_now,
            attitude=attitude,
            guidance=guidance,
            **changes,
        )
        self._status.write()

    def ended(self, run: Run, error: str, **changes: Any) -> None:
        """Write the last status, with the poses of the record."""
        done, total = _count_stored(run, self.view.progress.done, self.view.progress.total)
        self.view = replace(self.view, progress=replace(self.view.progress, done=done, total=total))
        extent = run.extent if run.state == "complete" else ""
        self.publish(phase="ended", state=run.state, asked=None, error=error, extent=extent, **changes)

    def stop_source(self, signal_name: str) -> str:
        return stop_source_of(self._status.key, signal_name)

    def begun(self, run: str) -> None:
        super().begun(run)
        self.publish(phase="running", run=run, error="", moving=())

    def changed(self) -> None:
        """Write the status, unless that was done a moment ago."""
        if time.monotonic() - self._written_s >= self._every_s:
            self.publish()


def open_question(question: Question, proposed: str) -> OpenQuestion:
    """A question in the form of the status."""
    drawing = drawing_of(question)
    yes_or_no = ("yes", "no") if isinstance(question, Confirm) else ()
    choices = question.choices if isinstance(question, Choice) else yes_or_no
    attitude = asdict(drawing) if drawing else None
    return OpenQuestion(question.name, question.text, question.accepts, choices, proposed, attitude=attitude)
