"""Repair of a damaged schema: SQLite refuses every table of a file if one entry of its schema has changed.

The tables are known here, so that only the root page of each is needed from the file. The entries are written anew in
a copy, without indexes, whose entries can be damaged too.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from sqlalchemy import Column, Integer, Table
from sqlalchemy.dialects import sqlite as dialect

from rig.record.schema import metadata

KNOWN = frozenset(metadata.tables)
OLDEST = {"runs", "poses", "blocks", "events"}  # tables that the record of every version has
TABLE, INDEX = ["CREATE TABLE"], ["CREATE INDEX"]  # how an entry begins; an index of a key has no text
STATEMENTS = TABLE + INDEX
UNREADABLE = (sqlite3.Error, UnicodeDecodeError)  # the second: SQLite quotes unreadable bytes in its messages


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
    """Write the schema of the file anew. Raises sqlite3.Error if its first page cannot be read."""
    with closing(sqlite3.connect(path, isolation_level=None)) as file:
        file.text_factory = lambda data: data.decode("utf-8", "replace")
        file.execute("PRAGMA writable_schema = ON")  # entries that cannot be read are no error then
        tables = dict(_tables(file.execute("SELECT name, rootpage, sql FROM sqlite_master").fetchall()))
        file.execute("DELETE FROM sqlite_master")
        for name, root in tables.items():
            row = ("table", name, name, root, _statement(metadata.tables[name]))
            file.execute("INSERT INTO sqlite_master VALUES (?, ?, ?, ?, ?)", row)


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
