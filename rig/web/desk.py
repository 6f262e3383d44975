"""What lies open on the desk. The server has one: a page that is closed and opened again finds everything as it was."""

from __future__ import annotations

import os
from collections import OrderedDict
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from rig.files import RECORD, home
from rig.record import Record, Run

if TYPE_CHECKING:
    from rig.services.session import ModelSession

MOST_OPEN = 6  # sessions that are kept: each holds its data
MODELS = "models"  # the folder in the home where the workbench saves models
FILES = "files"  # the folder of files that were given to the workbench


@dataclass
class Desk:
    """`dark`: None as the browser likes it. `sessions`: the open model sessions, by data and model, last used last."""

    bench_file: Path | None
    dark: bool | None = None
    sessions: OrderedDict[tuple[str, str], ModelSession] = field(default_factory=OrderedDict)

    def open(self, data: str, model: str) -> ModelSession:
        """The open session, or a new one; `model` "" is the one by default. Raises what `model_session` raises."""
        from rig.services.request import Request
        from rig.services.session import model_session

        request = Request(data, model or None, self.bench_file)
        found = self.sessions.get((data, model)) or model_session(request)
        self.keep(data, model, found)
        return found

    def keep(self, data: str, model: str, session: ModelSession) -> None:
        """How far the model has grown."""
        self.sessions[data, model] = session
        self.sessions.move_to_end((data, model))
        while len(self.sessions) > MOST_OPEN:
            self.sessions.popitem(last=False)

    def forget(self, data: str) -> None:
        """Begin anew with `data`, which may have changed."""
        for key in [key for key in self.sessions if key[0] == data]:
            del self.sessions[key]


def runs() -> list[Run]:
    """Every run, newest first; none where nothing is recorded yet. Raises RecordError."""
    if not Record.is_there():
        return []
    with Record.to_read() as record:
        return record.runs()


def lab_read() -> str | None:
    """The lab's record, for people, where the workbench shows that instead of the rig's own."""
    if not (url := os.environ.get(RECORD)):
        return None
    from rig.record.lab import lab_url, shown

    return shown(lab_url(url, RECORD))


def models(chosen: str = "", default: str = "by kind of data") -> dict[str, str]:
    """The models to choose from, by name or file, with names for people; "" is that by default."""
    from calibrations.model.file import shipped_names

    found = {"": default, **{name: name for name in shipped_names()}, **saved_models()}
    return found if chosen in found else {**found, chosen: chosen}


def saved_models() -> dict[str, str]:
    """Models that the workbench saved: their files, and names for people."""
    return {str(path): f"{path.stem} (saved)" for path in sorted((home() / MODELS).glob("*.yaml"))}
