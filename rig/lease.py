"""Who works on a run or holds a wire: a lock on a file, which the kernel gives back however its holder ends."""

from __future__ import annotations

import fcntl
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rig.errors import Busy

FOLDER = "locks"
ATTEMPTS, PAUSE_S = 20, 0.01  # who only looks whether it is held holds it for an instant


@contextmanager
def lease(folder: Path, name: str, what: str) -> Iterator[None]:
    """Hold `name`, for people `what`, among all processes that use `folder`. Raises Busy when another holds it."""
    path = _path(folder, name)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as file:
        _lock(file.fileno(), what)
        yield  # the file stays: were it removed, two could hold a lock of its name


def is_held(folder: Path, name: str) -> bool:
    """Whether a process holds `name` now."""
    try:
        with _path(folder, name).open() as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    return False


def _lock(fileno: int, what: str) -> None:
    for attempt in range(ATTEMPTS):
        try:
            fcntl.flock(fileno, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if attempt + 1 < ATTEMPTS:
                time.sleep(PAUSE_S)
        else:
            return
    raise Busy(f"another process works on {what}; let it finish, or stop it with Ctrl-C")


def _path(folder: Path, name: str) -> Path:
    return folder / FOLDER / f"{name}.lock"
