"""Locks of runs and wires: a lock on a file. The kernel releases it when the process ends.

The file names the process that holds the lock: {"pid": 4711, "what": "run 20240502-...", "since": "14:03:22", "runs":
"/home/..."}. The lock of a wire belongs to the machine, and `runs` is the folder with the locks of its holder's runs.
"""

from __future__ import annotations

import fcntl
import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import Any

from rig.errors import Busy

FOLDER = "locks"
ATTEMPTS, PAUSE_S = 20, 0.01  # `is_held` in another process holds the lock for an instant


@contextmanager
def lease(folder: Path, name: str, purpose: str, runs: Path | None = None) -> Iterator[None]:
    """Hold the lock `name` in `folder`; `purpose` names it for people.

    `runs`: the folder with the locks of runs, if it is another one; then all users share this lock. Raises Busy
    if another process holds it.
    """
    path = _path(folder, name)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+", encoding="utf-8") as file:
        if runs is not None:
            with suppress(OSError):  # another user made them
                path.parent.chmod(0o777)
                path.chmod(0o666)
        if not _lock(file.fileno()):
            raise Busy(f"{_describe_holder(path)} uses {purpose}; wait until it ends, or stop it with Ctrl-C")
        start_time = datetime.now().astimezone()
        file.truncate(0)
        json.dump(
            {
                "pid": os.getpid(),
                "what": purpose,
                "since": f"{start_time:%Y-%m-%d %H:%M:%S}",
                "runs": str(runs or folder),
            },
            file,
        )
        file.flush()
        yield  # the file stays: without it two processes could hold locks with the same name


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


def _lock(fileno: int) -> bool:
    """Lock the file. Returns False if another process holds the lock."""
    for attempt in range(ATTEMPTS):
        with suppress(BlockingIOError):
            fcntl.flock(fileno, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        if attempt + 1 < ATTEMPTS:
            time.sleep(PAUSE_S)
    return False


def _describe_holder(path: Path) -> str:
    """The process that holds a lock, its start, and its run."""
    holder = _holder(path)
    if not holder:
        return "another process"
    locks = Path(str(holder.get("runs", path.parent.parent))) / FOLDER
    holders = [_holder(lock_path) for lock_path in sorted(locks.glob("*.lock")) if lock_path != path]
    runs = [str(o["what"]) for o in holders if o.get("pid") == holder["pid"] and str(o["what"]).startswith("run ")]
    run_text = f", with {runs[-1]}" if runs else ""
    return f"another process ({holder['pid']}, since {holder['since']}{run_text})"


def _holder(path: Path) -> dict[str, Any]:
    """The last holder according to the file; empty if the file cannot be read."""
    with suppress(OSError, ValueError):
        document = json.loads(path.read_text(encoding="utf-8"))
        if isinstance(document, dict) and {"pid", "what", "since"} <= document.keys():
            return document
    return {}


def _path(folder: Path, name: str) -> Path:
    return folder / FOLDER / f"{name}.lock"
