"""Who works on a run: a lock on a file of the run's name, which the kernel gives back however its holder ends."""

from __future__ import annotations

import fcntl
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rig.errors import RunBusy

FOLDER = "locks"
ATTEMPTS, PAUSE_S = 20, 0.01  # who only looks whether it is held holds it for an instant


@contextmanager
def lease(folder: Path, run: str) -> Iterator[None]:
    """Hold `run` of the record in `folder`. Raises RunBusy when another process does."""
    path = _path(folder, run)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as file:
        _lock(file.fileno(), run)
        yield  # the file stays: were it removed, two could hold a lock of its name


def is_held(folder: Path, run: str) -> bool:
    """Whether a process works on `run` now."""
    try:
        with _path(folder, run).open() as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    return False


def _lock(fileno: int, run: str) -> None:
    for attempt in range(ATTEMPTS):
        try:
            fcntl.flock(fileno, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if attempt + 1 < ATTEMPTS:
                time.sleep(PAUSE_S)
        else:
            return
    raise RunBusy(f"another process works on run {run}; let it finish, or stop it with Ctrl-C")


def _path(folder: Path, run: str) -> Path:
    return folder / FOLDER / f"{run}.lock"
