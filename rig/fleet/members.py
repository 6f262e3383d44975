"""The sensors of a fleet: batch, rig and table of each.

A source is one of
    an index   a CSV file with the column `file` or `data` (a file in its folder, or a run); also sensor, batch, rig
    a folder   all its CSV files; an index in it named `fleet.csv` is preferred
    a table    one CSV file
    a run      RUN (all its sensors) or RUN/SENSOR of the record
Without these columns, batch, rig and sensor are constants of the table (`# batch: L7`), the name of the bench of the
run, and the name of the file.
"""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from calibrations.errors import DataError
from calibrations.files import open_text_file
from calibrations.table import NUMBERS
from calibrations.tables import MEANS
from calibrations.text import as_written
from rig.errors import RigError, UnknownRun
from rig.record import Record, Run
from rig.services.history import members

INDEX = "fleet.csv"
COLUMNS = ("sensor", "batch", "rig", "file", "data")


@dataclass(frozen=True)
class Member:
    """One sensor. `data` is the path of its table or, with `run`, the name of a run in the record.

    `digest` is a digest of the data. `fault` is the reason why the data cannot be read, else None.
    """

    sensor: str
    batch: str
    rig: str
    data: str
    digest: str = ""
    fault: str | None = None
    run: bool = False


def fleet_of(sources: Iterable[str]) -> list[Member]:
    """All sensors of the sources, without repetition; without a source, those of all complete runs of the record.

    A table that cannot be read gives a member with a fault. Raises RigError for a missing source, and for two members
    with the same name.
    """
    source_names = list(sources)
    members = (
        [member for source in source_names for member in _members_of(source)]
        if source_names
        else list(_record_members())
    )
    if not members:
        raise RigError(
            f"no sensor in {', '.join(source_names) or 'the record'}; name an index, a folder, tables or runs"
        )
    unique = list({(member.data, member.sensor): member for member in members}.values())
    by_name: dict[str, Member] = {}
    for member in unique:
        if (earlier := by_name.setdefault(member.sensor, member)) is not member:
            raise RigError(
                f"the sensor {member.sensor} occurs twice: {earlier.data} and {member.data}; "
                "give each its name in the column `sensor` of an index, or leave one out"
            )
    return unique


def content(member: Member) -> str:
    """The text of a member's file. Raises DataError."""
    with open_text_file(Path(member.data)).lines() as lines:
        return "".join(lines)


def _members_of(source: str) -> Iterator[Member]:
    path = Path(source)
    if path.is_dir():
        index = path / INDEX
        files = sorted(path.glob("*.csv"))
        yield from _index_members(index) if index.is_file() else (_file_member(file, {}) for file in files)
    elif path.is_file():
        yield from _index_members(path) if _is_index(path) else [_file_member(path, {})]
    else:
        yield from _run_members(source, {})


def _is_index(path: Path) -> bool:
    head = _head(path)
    return bool({"file", "data"} & set(head)) and not NUMBERS & set(head)


def _head(path: Path) -> list[str]:
    try:
        with open_text_file(path).lines() as lines:
            first = next((line for line in lines if not line.startswith("#") and line.strip()), "")
    except DataError:
        return []
    return [cell.strip() for cell in next(csv.reader([first]), [])]


def _index_members(path: Path) -> Iterator[Member]:
    """The members of an index. Raises RigError for an unknown column and for a row without data."""
    with open_text_file(path).lines() as lines:
        rows = list(csv.DictReader(io.StringIO("".join(line for line in lines if not line.startswith("#")))))
    for number, row in enumerate(rows, 2):
        cells = {
            name.strip(): (cell or "").strip() for name, cell in row.items() if isinstance(cell, str | None) and name
        }
        if unknown := set(cells) - set(COLUMNS):
            raise RigError(
                f"{path}: an index can have the columns {', '.join(COLUMNS)}, but not {', '.join(sorted(unknown))}"
            )
        file_name = cells.get("file") or cells.get("data")
        if not file_name:
            raise RigError(f"{path}, line {number}: has no file and no run; fill in the column `file` or `data`")
        data_path = path.parent / file_name
        cells_given = {name: cells[name] for name in ("sensor", "batch", "rig") if cells.get(name)}
        if cells.get("file") or data_path.is_file():
            yield _file_member(data_path, cells_given)
        else:
            yield from _run_members(file_name, cells_given)


def _file_member(path: Path, given_names: dict[str, str]) -> Member:
    member = Member(
        given_names.get("sensor", path.stem), given_names.get("batch", ""), given_names.get("rig", ""), str(path)
    )
    try:
        text = content(member)
    except DataError as error:
        return replace(member, fault=str(error))
    constants = {
        key.strip(): value.strip() for key, _, value in map(_constant, text.splitlines()[:50]) if value.strip()
    }
    return Member(
        sensor=given_names.get("sensor") or constants.get("serial") or constants.get("sensor") or path.stem,
        batch=given_names.get("batch") or constants.get("batch", ""),
        rig=given_names.get("rig") or constants.get("rig", ""),
        data=str(path),
        digest=hashlib.sha256(text.encode()).hexdigest(),
    )


def _constant(line: str) -> tuple[str, str, str]:
    return line[1:].partition(":") if line.startswith("#") else ("", "", "")


def _run_members(name: str, given_names: Mapping[str, Any]) -> Iterator[Member]:
    """The sensors of a run, or the named sensor. Raises UnknownRun."""
    run_id, slash, sensor_name = name.partition("/")
    if not run_id:
        raise UnknownRun(f"{name}: there is no such file or folder")
    try:
        with Record.to_find(run_id) as record:
            run = record.run(run_id)
            sensors = list(_members(record, run))
    except UnknownRun as error:
        raise UnknownRun(f"{name}: there is no such file or folder, and {error}") from None
    selected = [member for member in sensors if not slash or member.data == f"{run.run}/{sensor_name}"]
    if not selected:
        raise UnknownRun(f"run {run_id} has no sensor {sensor_name!r}; it has {', '.join(m.data for m in sensors)}")
    yield from (replace(member, **given_names) for member in selected)


def _record_members() -> Iterator[Member]:
    """The last complete run of each sensor."""
    if not Record.is_there():
        return
    with Record.to_read() as record:
        sensor_names: set[str] = set()
        for run in record.runs():
            if run.state == "complete" and run.kind in MEANS:
                yield from (m for m in _members(record, run) if m.sensor not in sensor_names)
                sensor_names |= set(members(run))


def _members(record: Record, run: Run) -> Iterator[Member]:
    batch, rig = (str(as_written(run.constants[name])) if name in run.constants else "" for name in ("batch", "rig"))
    state = hashlib.sha256(f"{run.run} {run.configuration} {run.ended} {record.excluded(run.run)}".encode()).hexdigest()
    for sensor, member in (members(run) or {run.run: ""}).items():
        data = f"{run.run}/{member}" if member else run.run
        digest = hashlib.sha256(f"{state} {member}".encode()).hexdigest()
        yield Member(sensor, batch, rig or str(run.bench.get("name", "")), data, digest, run=True)
