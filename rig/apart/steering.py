"""Starts runs in processes of their own, and steers them: pause, go on, stop, answer. Any process may steer any."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from rig.apart.order import Order, file, new_key
from rig.apart.status import Status, keys, read, tidy
from rig.errors import RigError

UNATTENDED = "it runs unattended, and a pause would end it: stop it, and resume it later"
IN_ITS_TERMINAL = "it was begun in a terminal, and asks there"
_children: list[subprocess.Popen[bytes]] = []  # so that those that have ended are taken notice of


def begin(procedure: str, settings: Mapping[str, str], bench_file: Path | None, attended: bool) -> str:
    """Start `procedure` in a process of its own; its key. What is wrong with it, its status will say."""
    return _begin(Order(new_key(), procedure, dict(settings), str(bench_file or ""), attended=attended))


def go_on(run: str, procedure: str, bench_file: Path | None, attended: bool) -> str:
    """Resume a run in a process of its own; its key."""
    return _begin(Order(new_key(), procedure, {}, str(bench_file or ""), run, attended))


def _begin(order: Order) -> str:
    file(order.key, "log").parent.mkdir(parents=True, exist_ok=True)
    tidy()
    os.mkfifo(file(order.key, "answers"))
    with file(order.key, "log").open("wb") as log:
        words = [sys.executable, "-m", "rig.apart.process", order.text()]
        child = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True)  # noqa: S603
    _children.append(child)
    return order.key


def latest() -> Status | None:
    """How the newest process stands that has not ended, else the newest; None where there was none."""
    _children[:] = [child for child in _children if child.poll() is None]
    found = [status for key in reversed(keys()) if (status := read(key)) is not None]
    return next((status for status in found if status.phase != "ended"), found[0] if found else None)


def pause(status: Status) -> None:
    """Bring the stages to rest at once; the run waits for what it is told. Raises RigError where nobody would tell."""
    if status.seat == "nobody":
        raise RigError(UNATTENDED)
    _signal(status, signal.SIGINT)


def stop(status: Status) -> None:
    """Bring the stages to rest at once and end the run; `rig resume` could go on with it."""
    if status.phase == "paused" and status.seat == "page":
        answer(status, "end")
    else:
        _signal(status, signal.SIGTERM)


def answer(status: Status, text: str) -> None:
    """Answer what is asked. Raises RigError where nothing is asked any more, or another asks."""
    if status.seat == "terminal":
        raise RigError(IN_ITS_TERMINAL)
    if status.asked is None:
        raise RigError("nothing is asked")
    try:
        pipe = os.open(file(status.key, "answers"), os.O_WRONLY | os.O_NONBLOCK)
    except OSError as error:
        if error.errno == errno.ENXIO:
            raise RigError(f"nobody waits for an answer to {status.asked.text!r} any more") from None
        raise
    with os.fdopen(pipe, "w", encoding="utf-8") as writer:
        json.dump({"name": status.asked.name, "text": text}, writer)


def _signal(status: Status, number: signal.Signals) -> None:
    if status.phase != "ended":
        with suppress(ProcessLookupError):
            os.kill(status.pid, number)
