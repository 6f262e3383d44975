"""A damaged record: every row that can still be read, copied into a new one, and what is lost, told.

SQLite keeps rows in pages, so damage at one place loses some rows of one table. Each table is read from both of its
ends to the damage; a pose without its samples is left behind with them.
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
UNREADABLE = (sqlite3.Error, UnicodeDecodeError)  # of its own messages, which quote what it cannot read


@dataclass(frozen=True)
class Recovered:
    """Rows that were copied, by table; tables with rows that could not be read; poses whose samples are spoilt."""

    rows: Mapping[str, int]
    damaged: tuple[str, ...]
    spoilt: tuple[str, ...]


def recover(source: Path, folder: Path) -> Recovered:
    """Copy what can be read of the record in the file `source` into a new record in `folder`.

    Raises RecordError where `folder` has a record already, or the file is none at all.
    """
    target = folder / FILE
    if target.exists():
        raise RecordError(f"{target}: is there already; name a folder without a record")
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
    """The damaged file, with its log, never written to."""
    try:
        old = sqlite3.connect(f"{source.resolve().as_uri()}?mode=ro", uri=True)
        old.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except UNREADABLE as error:
        raise RecordError(f"{source}: nothing of it can be read ({error}); restore a copy") from None
    return old


def _copied(old: sqlite3.Connection, new: sqlite3.Connection, table: str) -> tuple[int, bool]:
    """How many rows of a table were copied, and whether that is all of them."""
    known = {row[1] for row in new.execute(f"PRAGMA table_info({table})")}
    try:
        names = [row[1] for row in old.execute(f"PRAGMA table_info({table})") if row[1] in known]
    except UNREADABLE:
        return 0, False
    if not names:
        return 0, True  # a table that is younger than the record
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
    """Rows up to the first that cannot be read, which is None."""
    try:
        yield from old.execute(select)
    except UNREADABLE:
        yield None


def _spoilt(new: sqlite3.Connection) -> Iterator[str]:
    """Poses whose samples came, but are not what was written; they are taken out."""
    for run, number, samples in new.execute("SELECT run, number, samples FROM blocks").fetchall():
        try:
            codec.decode(samples)
        except ValueError:
            new.execute("DELETE FROM blocks WHERE run = ? AND number = ?", (run, number))
            yield f"run {run}, pose {number}"
