"""The content of data and model of an analysis, and whether it has changed since."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from rig.record import Record
from rig.services.tables import SEPARATOR, names_of


@dataclass(frozen=True)
class Content:
    """`key` changes with every row, exclusion, constant, and with the model's file.

    `extent`: number of rows as text, "" for a file. `growing`: a run in progress adds rows.
    """

    key: str
    extent: str = ""
    growing: bool = False


def content_of(data: str, model: str | None) -> Content:
    """The present content of `data` (a file, a run, a sensor of a run, several of these) and `model`.

    Reads no samples. Raises UnknownRun, RecordError, OSError.
    """
    of_model = _file_digest(Path(model)) if model and Path(model).is_file() else model or ""
    if len(names := names_of(data)) > 1:
        parts = [content_of(name, model) for name in names]
        extent = SEPARATOR.join(part.extent or "a file" for part in parts)
        return Content(_key(*(part.key for part in parts)), extent, any(part.growing for part in parts))
    if Path(data).is_file():
        return Content(_key("file", _file_digest(Path(data)), of_model))
    name, _, sensor = data.partition("/")
    with Record.to_find(name) as record:
        run = record.run(name)
        excluded = sorted(record.excluded(run.run).items())
        readings = [(reading.name, reading.value) for reading in record.readings(run.run)]
        count = record.next_number(run.run)
    of_run = (run.run, run.uid, run.rows, count, excluded, readings, dict(run.constants), sensor, of_model)
    return Content(_key(*of_run), run.extent, run.state == "running")


def _key(*parts: object) -> str:
    return hashlib.sha256(json.dumps(parts, default=str).encode()).hexdigest()


def _file_digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
