"""The content of a run: digests that are equal in all records with the same content, and rows to copy.

digest   SHA-256 of the run and of all its rows in order
head     SHA-256 of the parts that can change after the end of a run: results and events (an exclusion is an event). It
         is fast, because it does not read the samples.

The database computes the SHA-256 of bytes (samples, columns). The digest does not contain the name of the run, numbers
given by a database, and the state of a simulated bench, which only a resume needs.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from typing import Any

from sqlalchemy import ColumnElement, Connection, LargeBinary, Row, Select, Table, func, select

from rig.errors import UnknownRun
from rig.record.schema import blocks, columns, dwells, events, log, poses, readings, runs

# Each table with the column of its order. After the end of a run only events are added.
ORDER = {
    poses: poses.c.number,
    blocks: blocks.c.number,
    dwells: dwells.c.number,
    readings: readings.c.name,
    columns: columns.c.position,
    log: log.c.line,
    events: events.c.event,
}
DATABASE_NUMBERS = (events.c.event, log.c.line)  # numbers given by the database
START_COLUMNS = ("run", "procedure", "created", "configuration", "source", "identities")  # set when a run begins


def digest(connection: Connection, run: str) -> str:
    """SHA-256 of the content of `run`."""
    sha = hashlib.sha256(_line(run_row(connection, run)))
    for table in ORDER:
        sha.update(table.name.encode())
        for row in connection.execute(rows_of(table, run, counted=True)):
            sha.update(_line(row))
    return sha.hexdigest()


def head(connection: Connection, run: str) -> str:
    """SHA-256 of the parts of a complete run that can change. An excluded pose is part of it by its event."""
    sha = hashlib.sha256(_line(run_row(connection, run)))
    sha.update(_line(connection.execute(rows_of(events, run)).all()))
    return sha.hexdigest()


def run_row(connection: Connection, run: str) -> Row[Any]:
    """The row of the run, without its names and its checksum. Raises UnknownRun."""
    columns = [column for column in runs.c if column not in (runs.c.run, runs.c.uid, runs.c.checksum)]
    row = connection.execute(select(*columns).where(runs.c.run == run)).one_or_none()
    if row is None:
        raise UnknownRun(f"no run {run!r}")
    return row


def uid_of(connection: Connection, run: str) -> str:
    """The identifier of a run in every record. For a run of an older program it is derived from START_COLUMNS."""
    row = connection.execute(select(runs).where(runs.c.run == run)).one()._mapping
    return row["uid"] or hashlib.sha256(_line([row[name] for name in START_COLUMNS])).hexdigest()[:32]


def rows_of(table: Table, run: str, counted: bool = False) -> Select[Any]:
    """The rows of a run in order, without the columns that belong to one record only.

    With `counted`, bytes are replaced by their SHA-256, and checksums are omitted: older records have none.
    """
    columns: Iterable[ColumnElement[Any]] = (
        column for column in table.c if column not in (*DATABASE_NUMBERS, table.c.run)
    )
    if counted:
        columns = (
            func.sha256(column) if isinstance(column.type, LargeBinary) else column
            for column in columns
            if column.name != "checksum"
        )
    query = select(*columns).where(table.c.run == run).order_by(ORDER[table])
    return query.execution_options(yield_per=32)


def count(connection: Connection, run: str) -> dict[Table, int]:
    """The number of rows of a run in each table."""
    counts = [select(func.count()).where(table.c.run == run).scalar_subquery() for table in ORDER]
    return dict(zip(ORDER, connection.execute(select(*counts)).one(), strict=True))


def _line(row: object) -> bytes:
    """A row, or several, as canonical JSON; floats to their last bit."""
    return json.dumps(row, default=_json_value).encode()


def _json_value(value: object) -> object:
    return value.hex() if isinstance(value, bytes | memoryview) else tuple(value)  # type: ignore[arg-type]
