"""Recovery of a damaged record: copies every readable row into a new record, and reports the losses.

SQLite stores rows in pages, so damage at one place loses some rows of one table. Each table is read from both ends up
to the damage. A pose without its samples is not copied.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from rig.errors import RecordError
from rig.record import codec
from rig.record.file import open_file
from rig.record.schema import metadata

FILE = "record.db"
UNREADABLE = (sqlite3.Error, UnicodeDecodeError)  # the second: SQLite quotes unreadable bytes in its messages


@dataclass(frozen=True)
class Recovered:
    """The number of copied rows by table, the tables with unreadable rows, and the poses with damaged samples."""

    rows: Mapping[str, int]
    damaged: tuple[str, ...]
    spoilt: tuple[str, ...]


def recover(source: Path, folder: Path) -> Recovered:
    """Copy the readable rows of the record in the file `source` into a new record in `folder`.

    Raises RecordError if `folder` has a record already, or if the file is not a record.
    """
    target = folder / FILE
    if target.exists():
        raise RecordError(f"{target}: this record exists already; give a folder without a record")
    open_file(target).dispose()
    with closing(_opened(source)) as old, closing(sqlite3.connect(target)) as new:
        rows, damaged = {}, []
        for table in metadata.sorted_tables:
            copied, whole = _copied(old, new, table.name)
            rows[table.name] = copied
            if not whole:
                damaged.append(table.name)
        spoilt = tuple(_spoilt(new))
        new.execute("DELETE FROM poses WHERE NOT EXISTS (SELECT 1 FROM blocks WHERE blocks.run = poses.run "
                    "AND blocks.number = poses.number)")  # fmt: skip
        new.commit()
    return Recovered(rows, tuple(damaged), spoilt)


def _opened(source: Path) -> sqlite3.Connection:
    """The damaged file with its log, read-only."""
    try:
        old = sqlite3.connect(f"{source.resolve().as_uri()}?mode=ro", uri=True)
        old.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except UNREADABLE as error:
        raise RecordError(f"{source}: no row is readable ({error}); restore a copy of the record") from None
    return old


def _copied(old: sqlite3.Connection, new: sqlite3.Connection, table: str) -> tuple[int, bool]:
    """The number of copied rows of a table, and whether these are all."""
    known = {row[1] for row in new.execute(f"PRAGMA table_info({table})")}
    try:
        names = [row[1] for row in old.execute(f"PRAGMA table_info({table})") if row[1] in known]
    except UNREADABLE:
        return 0, False
    if not names:
        return 0, True  # this table is newer than the record
    places = ", ".join("?" * len(names))
    insert = f"INSERT OR IGNORE INTO {table} ({', '.join(names)}) VALUES ({places})"  # noqa: S608 - our own schema's
    copied, whole = 0, True
    for order in ("ASC", "DESC"):
        select = f"SELECT {', '.join(names)} FROM {table} ORDER BY rowid {order}"  # noqa: S608
        for row in _readable(old, select):
            if row is None:
                whole = False
            else:
                copied += new.execute(insert, row).rowcount
        if whole:
            break
    return copied, whole


def _readable(old: sqlite3.Connection, select: str) -> Iterator[tuple[object, ...] | None]:
    """Rows up to the first unreadable row, which is None."""
    try:
        yield from old.execute(select)
    except UNREADABLE:
        yield None


def _spoilt(new: sqlite3.Connection) -> Iterator[str]:
    """Delete the samples that are damaged. Returns their poses."""
    for run, number, samples in new.execute("SELECT run, number, samples FROM blocks").fetchall():
        try:
            codec.decode(samples)
        except ValueError:
            new.execute("DELETE FROM blocks WHERE run = ? AND number = ?", (run, number))
            yield f"run {run}, pose {number}"
