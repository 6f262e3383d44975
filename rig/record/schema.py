"""The tables of the record, and the differences between SQLite (the rig's record) and PostgreSQL (the lab's)."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from sqlalchemy import (
    JSON,
    BigInteger,
    Column,
    Connection,
    Dialect,
    Float,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Table,
    Text,
    TypeDecorator,
    inspect,
    text,
)
from sqlalchemy.sql.expression import TextClause
from sqlalchemy.types import TypeEngine

if TYPE_CHECKING:
    from sqlalchemy.dialects import postgresql, sqlite

SERVER = "postgresql"

# A number given by the database; SQLite needs the type INTEGER for it.
Counter = BigInteger().with_variant(Integer, "sqlite")


class DamagedDocument:
    """A document that cannot be read."""


DAMAGED = DamagedDocument()


class Document(TypeDecorator[Any]):
    """JSON as Python writes it, with Infinity. It is text in PostgreSQL, because its JSON type refuses Infinity.

    An unreadable document is DAMAGED, so that the other rows of a query stay readable.
    """

    impl = JSON
    cache_ok = True

    def load_dialect_impl(self, dialect: Dialect) -> TypeEngine[Any]:
        return dialect.type_descriptor(Text() if dialect.name == SERVER else JSON())

    def process_bind_param(self, value: Any, dialect: Dialect) -> Any:
        return json.dumps(value) if dialect.name == SERVER and value is not None else value

    def process_result_value(self, value: Any, dialect: Dialect) -> Any:
        return json.loads(value) if dialect.name == SERVER and value is not None else value

    def result_processor(self, dialect: Dialect, coltype: object) -> Callable[[Any], Any] | None:
        decode = super().result_processor(dialect, coltype)

        def decoded(value: Any) -> Any:
            try:
                return value if decode is None else decode(value)
            except (ValueError, TypeError):
                return DAMAGED

        return decoded


def is_new(connection: Connection, table: Table, values: Mapping[str, Any]) -> bool:
    """Insert a row unless its key exists. Returns whether it was inserted."""
    statement = insert_or(connection, table).values(values).on_conflict_do_nothing()
    return bool(connection.execute(statement, execution_options={"preserve_rowcount": True}).rowcount)


def insert_or(connection: Connection, table: Table) -> sqlite.Insert | postgresql.Insert:
    """An insert with a clause for an existing key."""
    from sqlalchemy.dialects import postgresql, sqlite  # slow to import, and nothing that only reads needs them

    return postgresql.insert(table) if connection.dialect.name == SERVER else sqlite.insert(table)


def newest_first(connection: Connection) -> TextClause:
    """The order of runs: by their begin in this record; with many rigs, by their clocks."""
    return text("runs.created DESC, runs.run DESC" if connection.dialect.name == SERVER else "runs.rowid DESC")


def give_sha256(connection: sqlite3.Connection) -> None:
    """Define the function sha256 of PostgreSQL in SQLite."""
    connection.create_function("sha256", 1, _sha256, deterministic=True)


def _sha256(data: bytes | None) -> bytes | None:
    return None if data is None else hashlib.sha256(data).digest()


# `SCHEMA` is the version of the tables. It is stored in `user_version` of a file, and on a server in the comment on the
# table `runs`.

SCHEMA = 9
metadata = MetaData()

runs = Table(
    "runs",
    metadata,
    Column("run", String, primary_key=True),
    Column("kind", String, nullable=False),  # of the table that its rows make: poses, positions, ...
    Column("procedure", String, nullable=False),  # "import" where a file was read
    Column("state", String, nullable=False),  # running, complete, stopped, failed
    Column("settings", Document, nullable=False),
    Column("bench", Document, nullable=False),  # the whole configuration, as it was
    Column("identities", Document, nullable=False),  # of the instruments, by role
    Column("configuration", String, nullable=False),  # hash of procedure, settings and bench
    Column("constants", Document, nullable=False),
    Column("source", String, nullable=False),
    Column("created", String, nullable=False),  # ISO 8601, UTC
    Column("ended", String),
    Column("message", String),  # why it stopped or failed
    Column("results", Document, nullable=False),
    Column("uid", String, nullable=False, server_default=""),  # the same in every record that the run is copied to
    Column("checksum", BigInteger),  # of the values that do not change; NULL in rows of older programs
)

poses = Table(
    "poses",
    metadata,
    Column("run", ForeignKey("runs.run"), primary_key=True),
    Column("number", Integer, primary_key=True),  # in the order of recording, from 0
    Column("alpha_deg", Float, nullable=False),
    Column("beta_deg", Float, nullable=False),
    Column("direction", Integer, nullable=False),
    Column("path", String, nullable=False),
    Column("mount_deg", Float, nullable=False),
    Column("flip", Integer, nullable=False),
    Column("t_s", Float, nullable=False),  # middle of the dwell
    Column("temperature_c", Float),
    Column("excluded", String),  # why a person excluded it from every analysis; it stays in the record
    Column("alpha_read_deg", Float),  # the reading of the dial of a stage that is turned by hand
    Column("beta_read_deg", Float),
    Column("up", String, nullable=False, server_default="z"),  # the edge along the table's normal
    Column("rate_deg_s", Float, nullable=False, server_default="0"),  # of beta, in a recorded turn
    Column("checksum", BigInteger),
)

readings = Table(  # numbers that belong to a run and to none of its poses
    "readings",
    metadata,
    Column("run", ForeignKey("runs.run"), primary_key=True),
    Column("name", String, primary_key=True),
    Column("at", String, nullable=False),  # ISO 8601, UTC
    Column("value", Float, nullable=False),
    Column("std", Float),
    Column("unit", String, nullable=False),
    Column("checksum", BigInteger),
)

blocks = Table(
    "blocks",
    metadata,
    Column("run", ForeignKey("runs.run"), primary_key=True),
    Column("number", Integer, primary_key=True),  # of the pose
    Column("rate_hz", Float, nullable=False),
    Column("start_s", Float, nullable=False),
    Column("channels", Document, nullable=False),
    Column("codec", String, nullable=False),
    Column("samples", LargeBinary, nullable=False),
    Column("checksum", BigInteger),
)

dwells = Table(  # for the pages, which draw a soak without its samples
    "dwells",
    metadata,
    Column("run", ForeignKey("runs.run"), primary_key=True),
    Column("number", Integer, primary_key=True),  # of the pose
    Column("n", Integer, nullable=False),  # samples
    Column("means", Document, nullable=False),  # V, by channel
    Column("stds", Document, nullable=False),
    Column("checksum", BigInteger),
)

columns = Table(  # of imported tables
    "columns",
    metadata,
    Column("run", ForeignKey("runs.run"), primary_key=True),
    Column("name", String, primary_key=True),
    Column("position", Integer, nullable=False),
    Column("numbers", LargeBinary),  # float64, little-endian
    Column("texts", Document),
    Column("checksum", BigInteger),
)

states = Table(  # of a simulated bench after the last recorded pose: clock, world, twins
    "states",
    metadata,
    Column("run", ForeignKey("runs.run"), primary_key=True),
    Column("state", Document, nullable=False),
)

events = Table(
    "events",
    metadata,
    Column("event", Counter, primary_key=True),
    Column("run", ForeignKey("runs.run"), nullable=False),
    Column("at", String, nullable=False),  # ISO 8601, UTC
    Column("what", String, nullable=False),
    Column("text", String, nullable=False),
    Index("events_of_run", "run"),
)

log = Table(  # events of a run, step by step; and messages on the wires, if requested
    "log",
    metadata,
    Column("line", Counter, primary_key=True),
    Column("run", ForeignKey("runs.run"), nullable=False),
    Column("at", String, nullable=False),  # ISO 8601, UTC
    Column("clock_s", Float, nullable=False),  # of the rig: simulated time on a simulated bench
    Column("who", String, nullable=False),  # the run, or an instrument's role
    Column("what", String, nullable=False),  # doing, kept, read, sent, heard, error, ...
    Column("text", String, nullable=False),
    Index("log_of_run", "run"),
)

arrivals = Table(  # of runs that rigs push into the lab's record; incomplete ones are not visible
    "arrivals",
    metadata,
    Column("uid", String, primary_key=True),  # of the run
    Column("run", ForeignKey("runs.run"), nullable=False, unique=True),  # its name here
    Column("at", String, nullable=False),  # ISO 8601, UTC
    Column("head", String),  # digest of the parts of a finished run that can change; NULL during the transfer
    Column("digest", String),  # SHA-256 of the run's rows here, computed here when they were complete
)

answers = Table(  # about one sensor of a fleet, so that the same question is not computed again
    "answers",
    metadata,
    Column("key", String, primary_key=True),  # digest of the data, the question and the program
    Column("sensor", String, nullable=False),
    Column("data", String, nullable=False),  # a file or a run
    Column("at", String, nullable=False),  # ISO 8601, UTC
    Column("answer", Document, nullable=False),
)


def upgrade(connection: Connection, version: int) -> None:
    """Make missing tables, and change those of the older `version`; 0 is a database without tables."""
    metadata.create_all(connection)
    for table, column, definition in (added for old in range(version or SCHEMA, SCHEMA) for added in NEW_COLUMNS[old]):
        if column not in {known["name"] for known in inspect(connection).get_columns(table)}:  # a new table has all
            connection.execute(text(f"ALTER TABLE {table} ADD COLUMN {column} {definition}"))


_TURNS = (("poses", "up", "VARCHAR NOT NULL DEFAULT 'z'"), ("poses", "rate_deg_s", "FLOAT NOT NULL DEFAULT 0"))
# Columns (table, name, definition) that the version after each one added to older tables, see `upgrade`.
NEW_COLUMNS: Mapping[int, tuple[tuple[str, str, str], ...]] = {
    1: (("poses", "excluded", "VARCHAR"),),
    2: (("poses", "alpha_read_deg", "FLOAT"), ("poses", "beta_read_deg", "FLOAT")),
    3: _TURNS,
    4: _TURNS,  # two programs wrote version 4, one of them without these columns
    5: (),  # a new table
    6: (("runs", "uid", "VARCHAR NOT NULL DEFAULT ''"),),  # and a new table
    7: (),  # a new table
    8: tuple((table, "checksum", "BIGINT") for table in ("runs", "poses", "readings", "blocks", "dwells", "columns")),
}
