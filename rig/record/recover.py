"""Recovery of a damaged record: copies every readable row into a new record, and reports the losses.

SQLite stores rows in pages, so damage at one place loses some rows of one table. Each table is read from both ends up
to the damage. A row with another checksum than at its insertion is not copied, nor a pose without its samples, nor
samples without their pose. A run with a damaged or lost entry gets a new entry with the readable parts, so that its
poses can be used.

A file without its end is read from a copy that is filled with zeros, and a file with a damaged header or schema from a
copy with a new one.
"""

from __future__ import annotations

import re
import shutil
import sqlite3
import struct
from collections.abc import Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, BinaryIO

from sqlalchemy import Column, Connection, Integer, Table, delete, insert, select, union, update
from sqlalchemy.dialects import sqlite as dialect

from rig.errors import RecordError
from rig.record import codec
from rig.record.checksum import CHECKED_COLUMNS, is_damaged
from rig.record.file import FILE, decode_text, open_file
from rig.record.schema import DAMAGED, blocks, metadata, poses, readings, runs

KNOWN = frozenset(metadata.tables)
OLDEST = {"runs", "poses", "blocks", "events"}  # tables that the record of every version has
TABLE, INDEX = ["CREATE TABLE"], ["CREATE INDEX"]  # how an entry begins; an index of a key has no text
STATEMENTS = TABLE + INDEX
UNREADABLE = (sqlite3.Error, UnicodeDecodeError)  # the second: SQLite quotes unreadable bytes in its messages


@dataclass(frozen=True)
class Recovered:
    """The number of copied rows by table, the tables with unreadable rows, the poses with damaged samples, and a phrase
    for each other loss.
    """

    rows: Mapping[str, int]
    damaged: tuple[str, ...]
    spoilt: tuple[str, ...]
    changed: tuple[str, ...] = ()


def recover(source: Path, folder: Path) -> Recovered:
    """Copy the readable rows of the record in the file `source` into a new record in `folder`.

    Raises RecordError if `folder` has a record already, or if the file is not a record.
    """
    target = folder / FILE
    if target.exists():
        raise RecordError(f"{target}: this record exists already; give a folder without a record")
    folder.mkdir(parents=True, exist_ok=True)
    unfinished, padded = folder / "recovery.db", folder / "padded.db"
    for file in (unfinished, padded):
        for leftover in folder.glob(f"{file.name}*"):
            leftover.unlink()  # of an attempt that failed
    try:
        recovered = _recover_rows(_complete_copy(source, padded), unfinished)
        unfinished.rename(target)
    finally:
        for leftover in (*folder.glob(f"{unfinished.name}*"), *folder.glob(f"{padded.name}*")):
            leftover.unlink()
    return recovered


def _recover_rows(source: Path, target: Path) -> Recovered:
    """Copy the readable rows of the file `source` into the new file `target`."""
    with closing(_open_damaged(source)) as old, closing(_open_new(target)) as new:
        rows, damaged = {}, []
        for table in metadata.sorted_tables:
            copied, is_complete = _copy_rows(old, new, table.name)
            rows[table.name] = copied
            if not is_complete:
                damaged.append(table.name)
        new.commit()
        replaced_runs = tuple(_remove_damaged_rows(target))
        damaged_samples = tuple(_remove_damaged_samples(new))
        for name, other_table in (("poses", "blocks"), ("blocks", "poses"), ("dwells", "poses")):
            match = f"{other_table}.run = {name}.run AND {other_table}.number = {name}.number"
            new.execute(f"DELETE FROM {name} WHERE NOT EXISTS (SELECT 1 FROM {other_table} WHERE {match})")  # noqa: S608
        new.commit()
        new.execute("PRAGMA journal_mode = DELETE")  # all is in one file, which gets its name now
    return Recovered(rows, tuple(damaged), damaged_samples, replaced_runs)


def _open_new(target: Path) -> sqlite3.Connection:
    """A new record with empty tables."""
    open_file(target).dispose()
    return sqlite3.connect(target)


_MAGIC = b"SQLite format 3\0"
_PAGE = 4096  # bytes
_START = _MAGIC + struct.pack(">H 6B", _PAGE, 2, 2, 0, 64, 32, 32)  # of the file of every record: page, with a log
_HEADER = struct.Struct(f">{len(_START)}x 4x I")  # the number of pages


def _complete_copy(source: Path, padded: Path) -> Path:
    """The file, or a copy that is filled up with zeros if the end is missing, and has a sound schema."""
    with source.open("rb") as file:
        head = file.read(_HEADER.size)
    if len(head) < _HEADER.size or not head.startswith(_MAGIC):
        return source  # is refused when it is opened
    pages, present = _HEADER.unpack(head)[0], -(-source.stat().st_size // _PAGE)
    is_whole, sound = present == pages, is_sound(source)
    if is_whole and sound:
        return source
    shutil.copyfile(source, padded)
    if (log := source.with_name(f"{source.name}-wal")).exists():
        shutil.copyfile(log, padded.with_name(f"{padded.name}-wal"))
    with padded.open("r+b") as file:
        _set_pages(file, max(present, pages))
    if not sound:
        with suppress(*UNREADABLE):  # else nothing is readable, and opening the record reports that
            rewrite_schema(padded)
    return padded


def _set_pages(file: BinaryIO, pages: int) -> None:
    """Write the header of a file with so many pages, and fill it up with zeros."""
    file.truncate(pages * _PAGE)
    file.seek(0)
    file.write(_START)
    file.seek(_HEADER.size - 4)
    file.write(pages.to_bytes(4))


def _remove_damaged_rows(target: Path) -> Iterator[str]:
    """Remove rows that changed on the disk, and make a new entry for runs without a sound one. Yields the losses."""
    engine = open_file(target)
    try:
        with engine.begin() as connection:
            checked = set(connection.execute(select(runs.c.run).where(runs.c.checksum.is_not(None))).scalars())
            for table in (table for table in CHECKED_COLUMNS if table is not runs):
                place = "name" if "name" in table.c else "number"
                key = (table.c.run, table.c[place])
                rows = connection.execute(select(table))
                wrong_rows = [
                    (row.run, getattr(row, place))
                    for row in rows
                    if is_damaged(table, row._mapping, row.run in checked)
                ]
                for run, number in wrong_rows:
                    connection.execute(delete(table).where(key[0] == run, key[1] == number))
                    yield f"run {run}, {table.name}: {number}"
            yield from _mend_runs(connection)
    finally:
        engine.dispose()


def _mend_runs(connection: Connection) -> Iterator[str]:
    for row in connection.execute(select(runs)).all():
        if is_damaged(runs, row._mapping):
            values: dict[str, Any] = {name: value for name, value in row._mapping.items() if value is DAMAGED}
            lost_values = ", ".join(values) or "one value; check its settings, constants and bench"
            message = f"recovered from a damaged record; unreadable: {lost_values}"
            mended: dict[str, Any] = {
                **{name: {} for name in values},
                "state": "failed",
                "message": message,
                "checksum": None,
            }
            connection.execute(update(runs).where(runs.c.run == row.run).values(mended))
            yield f"run {row.run}: {lost_values}"
    numbers = union(*[select(table.c.run) for table in (poses, blocks, readings)]).subquery()
    without_entry = select(numbers.c.run).where(numbers.c.run.not_in(select(runs.c.run)))
    for run in connection.execute(without_entry).scalars().all():
        documents: dict[str, Any] = {name: {} for name in ("settings", "bench", "identities", "constants", "results")}
        procedure = (*run.split("-"), "", "", "unknown")[2] or "unknown"
        connection.execute(insert(runs), {
            "run": run, "kind": "poses", "procedure": procedure, "state": "failed", "configuration": "", "created": "",
            "source": "a damaged record", "message": "recovered from a damaged record without the entry of this run",
            **documents})  # fmt: skip
        yield f"run {run}: its entry; settings, bench and constants are empty now"


def _open_damaged(source: Path) -> sqlite3.Connection:
    """The damaged file with its log, read-only."""
    try:
        old = sqlite3.connect(f"{source.resolve().as_uri()}?mode=ro", uri=True)
        old.text_factory = decode_text
        old.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except UNREADABLE as error:
        raise RecordError(f"{source}: no row is readable ({error}); restore a copy of the record") from None
    return old


def _copy_rows(old: sqlite3.Connection, new: sqlite3.Connection, table: str) -> tuple[int, bool]:
    """The number of copied rows of a table, and whether these are all."""
    columns = {row[1] for row in new.execute(f"PRAGMA table_info({table})")}
    names = [row[1] for row in old.execute(f"PRAGMA table_info({table})") if row[1] in columns]  # read at opening
    if not names:
        return 0, True  # this table is newer than the record
    places = ", ".join("?" * len(names))
    insert = f"INSERT OR IGNORE INTO {table} ({', '.join(names)}) VALUES ({places})"  # noqa: S608 - our own schema's
    copied, is_complete = 0, True
    for order in ("ASC", "DESC"):
        select = f"SELECT {', '.join(names)} FROM {table} ORDER BY rowid {order}"  # noqa: S608
        for row in _readable(old, select):
            if row is None:
                is_complete = False
            else:
                copied += new.execute(insert, [_writable(value) for value in row]).rowcount
        if is_complete:
            break
    return copied, is_complete


def _writable(value: object) -> object:
    """The value. A text with unreadable bytes gets replacement characters, one of them first: it is then not JSON."""
    if isinstance(value, str) and not value.isascii():
        data = value.encode("utf-8", "surrogateescape")
        decoded = data.decode("utf-8", "replace")
        return decoded if decoded == value else f"\ufffd{decoded}"
    return value


def _readable(old: sqlite3.Connection, select: str) -> Iterator[tuple[object, ...] | None]:
    """Rows up to the first unreadable row, which is None."""
    try:
        yield from old.execute(select)
    except UNREADABLE:
        yield None


def _remove_damaged_samples(new: sqlite3.Connection) -> Iterator[str]:
    """Delete the samples that are damaged. Returns their poses."""
    for run, number, samples in new.execute("SELECT run, number, samples FROM blocks").fetchall():
        try:
            codec.decode(samples)
        except ValueError:
            new.execute("DELETE FROM blocks WHERE run = ? AND number = ?", (run, number))
            yield f"run {run}, pose {number}"


# A damaged schema: SQLite refuses every table of a file if one entry of its schema has changed. The tables are known
# here, so only the root page of each is needed from the file. New entries are written in a copy, without indexes,
# whose entries can be damaged too.


def is_sound(path: Path) -> bool:
    """Whether SQLite can read the schema, and each table and column of it is known."""
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as file:
            names = {name for (name,) in file.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
            columns = {name: {row[1] for row in file.execute(f"PRAGMA table_info({name})")} for name in names & KNOWN}
    except UNREADABLE:
        return False
    return OLDEST <= names <= KNOWN and all(columns[name] <= {*metadata.tables[name].c.keys()} for name in names)


def rewrite_schema(path: Path) -> None:
    """Write a new schema of the file. Raises sqlite3.Error if that is not possible."""
    with closing(sqlite3.connect(path, isolation_level=None)) as file:
        file.text_factory = lambda data: data.decode("utf-8", "replace")
        file.execute("PRAGMA writable_schema = ON")  # then unreadable entries are not an error
        entries = [row for row in _readable(file, "SELECT name, rootpage, sql FROM sqlite_master") if row is not None]
    found, pages = _clear_schema(path)  # SQLite has moved the log into the file when it closed it
    tables = dict(_tables(entries)) | found
    with closing(sqlite3.connect(path, isolation_level=None)) as file:
        file.execute("PRAGMA writable_schema = ON")
        for name, root in tables.items():
            place = root if 1 < root < pages else pages  # unreadable, so that its rows are reported as lost
            row = ("table", name, name, place, _statement(metadata.tables[name]))
            file.execute("INSERT INTO sqlite_master VALUES (?, ?, ?, ?, ?)", row)


_SCHEMA = 100  # where the schema begins in the first page, after the header of the file
_EMPTY_PAGE = struct.Struct(">B H H H B")  # a table's leaf: type, free block, cells, start of the cells, fragments


def _clear_schema(path: Path) -> tuple[dict[str, int], int]:
    """Make the schema of the file empty, and add a page of zeros. Returns the root page of each table with an entry in
    the first page, and the number of pages.

    An entry is found by its text, so that damage to the lists of the page has no effect: names, root page, statement.
    """
    pages = path.stat().st_size // _PAGE + 1
    with path.open("r+b") as file:
        page = file.read(_PAGE)
        _set_pages(file, pages)
        file.seek(_SCHEMA)
        file.write(_EMPTY_PAGE.pack(13, 0, 0, _PAGE, 0).ljust(_PAGE - _SCHEMA, b"\0"))
    texts = {name: b"table" + 2 * name.encode() + b"(.{1,4})CREATE TABLE " for name in KNOWN}
    found = {name: re.search(text, page, re.DOTALL) for name, text in texts.items()}
    return {name: int.from_bytes(entry[1]) for name, entry in found.items() if entry is not None}, pages


def _tables(entries: list[tuple[Any, ...]]) -> Iterator[tuple[str, int]]:
    """(name, root page) of each table. A changed name is the nearest one that no other entry has."""
    created = [
        (str(name), root) for name, root, sql in entries if get_close_matches(str(sql)[:12], STATEMENTS, 1) == TABLE
    ]
    missing = set(KNOWN - {name for name, _ in created})
    for name, root in created:
        for match in [name] if name in KNOWN else get_close_matches(name, sorted(missing), 1):
            missing.discard(match)
            yield match, root


def _statement(table: Table) -> str:
    """The table without constraints, so that no index is needed."""
    return f"CREATE TABLE {table.name} ({', '.join(_column(column) for column in table.c)})"


def _column(column: Column[Any]) -> str:
    kind = column.type.compile(dialect.dialect())
    if column.primary_key and len(column.table.primary_key) == 1 and kind == Integer().compile():
        return f"{column.name} INTEGER PRIMARY KEY"  # the number of the row itself
    default = f" DEFAULT '{column.server_default.arg}'" if column.server_default is not None else ""  # type: ignore[attr-defined]
    return f"{column.name} {kind}{default}"
