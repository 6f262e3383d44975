"""What a run holds, as digests that are equal in every record that holds the same, and as rows to copy.

digest   SHA-256 of all of it: of the run, and of every row that belongs to it, in their order
head     of what changes once a run is complete, its results and events (each exclusion is one): quick, samples unread

Of bytes (samples, columns) the database gives their own SHA-256, so that they are counted where they are. A run's name
is no part of it, nor are numbers that a database gives; nor the state of a simulated bench, which only resuming needs.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from typing import Any

from sqlalchemy import ColumnElement, Connection, LargeBinary, Row, Select, Table, func, select

from rig.errors import UnknownRun
from rig.record.schema import blocks, columns, dwells, events, log, poses, readings, runs

# Each with the column that orders it. After a run is complete nothing but events is added to any of them.
ORDER = {
    poses: poses.c.number,
    blocks: blocks.c.number,
    dwells: dwells.c.number,
    readings: readings.c.name,
    columns: columns.c.position,
    log: log.c.line,
    events: events.c.event,
}
GIVEN = (events.c.event, log.c.line)  # by the database
MADE = ("run", "procedure", "created", "configuration", "source", "identities")  # of a run as it was begun


def digest(at: Connection, run: str) -> str:
    """Of all that is held of `run`."""
    sha = hashlib.sha256(_line(run_row(at, run)))
    for table in ORDER:
        sha.update(table.name.encode())
        for row in at.execute(rows_of(table, run, counted=True)):
            sha.update(_line(row))
    return sha.hexdigest()


def head(at: Connection, run: str) -> str:
    """Of what can change of a complete run. A pose that is left out is told by its event."""
    sha = hashlib.sha256(_line(run_row(at, run)))
    sha.update(_line(at.execute(rows_of(events, run)).all()))
    return sha.hexdigest()


def run_row(at: Connection, run: str) -> Row[Any]:
    """The run itself, without its names. Raises UnknownRun."""
    chosen = [column for column in runs.c if column not in (runs.c.run, runs.c.uid)]
    row = at.execute(select(*chosen).where(runs.c.run == run)).one_or_none()
    if row is None:
        raise UnknownRun(f"no run {run!r}")
    return row


def uid_of(at: Connection, run: str) -> str:
    """What names a run in every record; of a run of an older program, made of how it was begun."""
    row = at.execute(select(runs).where(runs.c.run == run)).one()._mapping
    return row["uid"] or hashlib.sha256(_line([row[name] for name in MADE])).hexdigest()[:32]


def rows_of(table: Table, run: str, counted: bool = False) -> Select[Any]:
    """The rows of a run in their order, few at a time, without what belongs to one record alone.

    With `counted`, bytes are told by their SHA-256.
    """
    kept: Iterable[ColumnElement[Any]] = (column for column in table.c if column not in (*GIVEN, table.c.run))
    if counted:
        kept = (func.sha256(column) if isinstance(column.type, LargeBinary) else column for column in kept)
    query = select(*kept).where(table.c.run == run).order_by(ORDER[table])
    return query.execution_options(yield_per=32)


def count(at: Connection, run: str) -> dict[Table, int]:
    """How many rows of each table belong to a run."""
    counts = [select(func.count()).where(table.c.run == run).scalar_subquery() for table in ORDER]
    return dict(zip(ORDER, at.execute(select(*counts)).one(), strict=True))


def _line(row: object) -> bytes:
    """A row, or several, as canonical JSON; floats to their last bit."""
    return json.dumps(row, default=_plain).encode()


def _plain(value: object) -> object:
    return value.hex() if isinstance(value, bytes | memoryview) else tuple(value)  # type: ignore[arg-type]
