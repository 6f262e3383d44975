"""Starts runs in processes of their own, and steers them: pause, go on, stop, answer. Any process may steer any."""

from __future__ import annotations

import errno
import json
import os
import secrets
import signal
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

from rig.apart.order import Order, file
from rig.apart.status import Status, keys, read
from rig.errors import RigError

KEPT = 20
_children: list[subprocess.Popen[bytes]] = []  # so that those that have ended are taken notice of


def begin(procedure: str, settings: Mapping[str, str], bench_file: Path | None, attended: bool) -> str:
    """Start `procedure` in a process of its own; its key. What is wrong with it, its status will say."""
    return _begin(Order(_new_key(), procedure, dict(settings), str(bench_file or ""), attended=attended))


def go_on(run: str, procedure: str, bench_file: Path | None, attended: bool) -> str:
    """Resume a run in a process of its own; its key."""
    return _begin(Order(_new_key(), procedure, {}, str(bench_file or ""), run, attended))


def _begin(order: Order) -> str:
    file(order.key, "log").parent.mkdir(parents=True, exist_ok=True)
    tidy()
    os.mkfifo(file(order.key, "answers"))
    with file(order.key, "log").open("wb") as log:
        words = [sys.executable, "-m", "rig.apart.process", order.text()]
        child = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True)  # noqa: S603
    _children.append(child)
    return order.key


def tidy() -> None:
    """Remove the files of all processes but the last KEPT; the record keeps their runs."""
    for key in keys()[:-KEPT]:
        for ending in ("answers", "log", "json"):
            file(key, ending).unlink(missing_ok=True)


def latest() -> Status | None:
    """How the newest process stands; None where there was none."""
    _children[:] = [child for child in _children if child.poll() is None]
    found = keys()
    return read(found[-1]) if found else None


def pause(status: Status) -> None:
    """Bring the stages to rest at once; the run waits for what it is told."""
    _signal(status, signal.SIGINT)


def stop(status: Status) -> None:
    """Bring the stages to rest at once and end the run; `rig resume` could go on with it."""
    if status.phase == "paused":
        answer(status, "end")
    else:
        _signal(status, signal.SIGTERM)


def answer(status: Status, text: str) -> None:
    """Answer what is asked. Raises RigError where nothing is asked any more."""
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


def _new_key() -> str:
    return f"{datetime.now(UTC):%Y%m%d-%H%M%S-%f}-{secrets.token_hex(2)}"
