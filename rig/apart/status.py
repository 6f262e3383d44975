"""How a run in a process of its own stands, as one small file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from rig.apart.order import FOLDER, file
from rig.files import write_whole
from rig.home import home
from rig.lease import is_held

KEPT = 20
Phase = Literal["starting", "running", "asking", "paused", "ended"]
Seat = Literal["page", "terminal", "nobody"]


@dataclass(frozen=True)
class Asked:
    """A question to a person. `proposed` is what a simulated technician would say, `refused` why the last answer was.

    `attitude`: how the sensor is to be mounted, where that is what is asked; keywords of `rig.drawings.Attitude`.
    """

    name: str
    text: str
    accepts: str
    choices: Sequence[str] = ()
    proposed: str = ""
    refused: str = ""
    attitude: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class Status:
    """`values` are keywords of `rig.running.seen.Value`, with `near`. `state` is the run's once it has ended.

    `seat`: where a person is asked, a page, the terminal that it was begun in, or nowhere: then it cannot pause.
    `error`: why it is paused, or why it did not end as it should. `moving`: what could not be stopped.
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
    asked: Asked | None = None
    error: str = ""
    moving: Sequence[str] = ()
    state: str = ""
    attitude: Mapping[str, Any] = field(default_factory=dict)
    seat: Seat = "page"

    def write(self) -> None:
        """Into its file, whole."""
        write_whole(file(self.key, "json"), json.dumps(asdict(self)))


def read(key: str) -> Status | None:
    """How the process `key` stands; None before it has said anything. One that was killed has ended."""
    try:
        document = json.loads(file(key, "json").read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    asked = document.pop("asked")
    status = Status(**document, asked=Asked(**asked) if asked else None)
    if status.phase == "ended" or is_held(home(), lock(key)):
        return status
    error = f"its process ended: {_last_words(key)}"
    return replace(status, phase="ended", state="stopped", asked=None, error=error)


def lock(key: str) -> str:
    """The name of the lock that a living process holds."""
    return f"{FOLDER}-{key}"


def keys() -> list[str]:
    """All processes that there were, newest last."""
    return sorted(path.stem for path in folder().glob("*.json"))


def folder() -> Path:
    """Where their files are."""
    return home() / FOLDER


def tidy() -> None:
    """Remove the files of all processes but the last KEPT; the record keeps their runs."""
    for key in keys()[:-KEPT]:
        if not is_held(home(), lock(key)):
            for ending in ("answers", "log", "json"):
                file(key, ending).unlink(missing_ok=True)


def _last_words(key: str) -> str:
    """The end of what it wrote to standard error."""
    path = file(key, "log")
    said = path.read_text(encoding="utf-8", errors="replace").strip() if path.exists() else ""
    return said.splitlines()[-1] if said else "it was killed; `rig resume` goes on with its run"
