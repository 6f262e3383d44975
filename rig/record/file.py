"""Opening the record's file: one SQLite database that a kill cannot tear.

Write-ahead log and synchronous=FULL: what a transaction has returned from is on the disk.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sqlalchemy import Engine, create_engine, event, text
from sqlalchemy.exc import DatabaseError, OperationalError

from rig.errors import RecordError
from rig.record.schema import MIGRATIONS, SCHEMA, metadata


def open_file(path: Path) -> Engine:
    """The file's engine; its tables are made where there are none, and brought up to date where they are older.

    Raises RecordError where it cannot be opened, is damaged, or was written by a newer program.
    """
    engine = create_engine(f"sqlite:///{path}")
    event.listen(engine, "connect", _prepare)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _make_tables(engine, path)
    except (OSError, OperationalError) as error:
        reason = error.orig if isinstance(error, OperationalError) else error.strerror
        raise RecordError(f"{path}: the record cannot be opened: {reason}; check RIG_HOME") from None
    except DatabaseError as error:
        reason = error.orig
        raise RecordError(f"{path}: the record is damaged ({reason}); move it away or restore a copy") from None
    return engine


def _make_tables(engine: Engine, path: Path) -> None:
    with engine.begin() as to:
        version = to.execute(text("PRAGMA user_version")).scalar_one()
        if version > SCHEMA:
            raise RecordError(
                f"{path}: written by a newer version of this program (schema {version}, this one knows {SCHEMA}); "
                "update the program, or name another folder in RIG_HOME"
            )
        if version < SCHEMA:
            metadata.create_all(to)
            for statement in (each for old in range(version or SCHEMA, SCHEMA) for each in MIGRATIONS[old]):
                to.execute(text(statement))
            to.execute(text(f"PRAGMA user_version = {SCHEMA:d}"))


def _prepare(connection: Any, _: Any) -> None:
    """What every connection does: a busy file is waited for, a commit reaches the disk."""
    connection.execute("PRAGMA busy_timeout = 10000")
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA synchronous = FULL")
    connection.execute("PRAGMA foreign_keys = ON")
