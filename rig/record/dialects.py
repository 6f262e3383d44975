"""All in which SQLite, the rig's own record, and PostgreSQL, the lab's, differ for those who read and write."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Mapping
from typing import Any

from sqlalchemy import JSON, BigInteger, Connection, Dialect, Integer, Table, Text, TypeDecorator, text
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.sql.expression import TextClause
from sqlalchemy.types import TypeEngine

SERVER = "postgresql"

# A number that the database gives; SQLite counts by its own INTEGER alone.
Counter = BigInteger().with_variant(Integer, "sqlite")


class Document(TypeDecorator[Any]):
    """JSON as Python writes it, with Infinity, which PostgreSQL's own type refuses: there it is text."""

    impl = JSON
    cache_ok = True

    def load_dialect_impl(self, dialect: Dialect) -> TypeEngine[Any]:
        return dialect.type_descriptor(Text() if dialect.name == SERVER else JSON())

    def process_bind_param(self, value: Any, dialect: Dialect) -> Any:
        return json.dumps(value) if dialect.name == SERVER and value is not None else value

    def process_result_value(self, value: Any, dialect: Dialect) -> Any:
        return json.loads(value) if dialect.name == SERVER and value is not None else value


def is_new(to: Connection, table: Table, values: Mapping[str, Any]) -> bool:
    """Insert a row, unless there is one of its key; whether it was inserted."""
    statement = insert_or(to, table).values(values).on_conflict_do_nothing()
    return bool(to.execute(statement, execution_options={"preserve_rowcount": True}).rowcount)


def insert_or(to: Connection, table: Table) -> sqlite.Insert | postgresql.Insert:
    """An insert that can say what is done where the key is there already."""
    return postgresql.insert(table) if to.dialect.name == SERVER else sqlite.insert(table)


def newest_first(at: Connection) -> TextClause:
    """The order of runs: as they were begun here; of many rigs, by their clocks."""
    return text("runs.created DESC, runs.run DESC" if at.dialect.name == SERVER else "runs.rowid DESC")


def give_sha256(connection: sqlite3.Connection) -> None:
    """The function that PostgreSQL has for bytes, under its name."""
    connection.create_function("sha256", 1, _sha256, deterministic=True)


def _sha256(data: bytes | None) -> bytes | None:
    return None if data is None else hashlib.sha256(data).digest()
