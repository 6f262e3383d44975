"""Opening the record's file: one SQLite database that a kill cannot tear.

Write-ahead log and synchronous=FULL: what a transaction has returned from is on the disk. Where the disk, its folder
or the file itself fails, now or later, that is a RecordError which says so.
"""

from __future__ import annotations

import os
import sqlite3
from pathlib import Path

from sqlalchemy import Connection, Engine, ExceptionContext, create_engine, event, text

from rig.errors import RecordError
from rig.record.dialects import give_sha256
from rig.record.schema import MIGRATIONS, SCHEMA, metadata

RECOVER = "move it away, or `rig doctor --recover FOLDER` copies what can still be read"
FAILURES = {  # primary code of SQLite: what has happened, and what to do
    sqlite3.SQLITE_FULL: "cannot be written: the disk is full; free some space, then go on with `rig resume`",
    sqlite3.SQLITE_READONLY: "cannot be written: it is read-only; make file and folder writable, or name another "
    "folder in RIG_HOME",
    sqlite3.SQLITE_IOERR: "cannot be read or written: the file system fails; look at the disk or the network share, "
    "then go on with `rig resume`",
    sqlite3.SQLITE_CANTOPEN: "cannot be opened; check RIG_HOME and the permissions of the folder",
    sqlite3.SQLITE_BUSY: "another process has been writing to it for long; let that finish, then try again",
    sqlite3.SQLITE_CORRUPT: f"the record is damaged; {RECOVER}",
    sqlite3.SQLITE_NOTADB: "the record is damaged, or no record at all; " + RECOVER,
}


def open_file(path: Path) -> Engine:
    """The file's engine; its tables are made where there are none, and brought up to date where they are older.

    In a folder that this user may not write, it is opened for reading alone. Raises RecordError where it cannot be
    opened, is damaged, or was written by a newer program; what is done with the engine later raises it too.
    """
    engine = create_engine(f"sqlite:///{path}", creator=lambda: _connected(path))
    event.listen(engine, "connect", lambda connection, _: give_sha256(connection))
    event.listen(engine, "handle_error", lambda context: _tell(context, path))
    event.listen(engine, "begin", lambda connection: _require_there(connection, path))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordError(f"{path}: the record cannot be opened: {error.strerror}; check RIG_HOME") from None
    _make_tables(engine, path)
    return engine


def _connected(path: Path) -> sqlite3.Connection:
    """A new connection: a busy file is waited for, a commit reaches the disk."""
    if path.exists() and not os.access(path.parent, os.W_OK):
        return sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True, check_same_thread=False)
    connection = sqlite3.connect(path, check_same_thread=False)
    try:
        _prepare(connection)
    except (UnicodeDecodeError, sqlite3.OperationalError) as error:  # SQLite quotes what it cannot read
        if getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR) == sqlite3.SQLITE_ERROR:  # at no fault of ours
            raise RecordError(f"{path}: {FAILURES[sqlite3.SQLITE_CORRUPT]} ({error})") from None
        raise
    return connection


def _prepare(connection: sqlite3.Connection) -> None:
    for pragma in ("busy_timeout = 10000", "journal_mode = WAL", "synchronous = FULL", "foreign_keys = ON"):
        connection.execute(f"PRAGMA {pragma}")


def _require_there(connection: Connection, path: Path) -> None:
    """SQLite writes on into a file that was removed, and nobody would ever read it. Raises RecordError."""
    try:
        inode = path.stat().st_ino
    except OSError as error:
        raise RecordError(f"{path}: is not there any more ({error.strerror}); look where its folder is") from None
    if connection.info.setdefault("inode", inode) != inode:
        raise RecordError(f"{path}: is another file than before; let nobody exchange it while a command runs")


def _tell(context: ExceptionContext, path: Path) -> None:
    """Raises RecordError for what the file or its disk is to blame for."""
    error = context.original_exception
    if isinstance(error, UnicodeDecodeError):
        raise RecordError(f"{path}: {FAILURES[sqlite3.SQLITE_CORRUPT]}") from None
    if isinstance(error, sqlite3.DatabaseError):
        code = getattr(error, "sqlite_errorcode", 0) & 0xFF
        if code in FAILURES:
            raise RecordError(f"{path}: {FAILURES[code]} ({error})") from None


def _make_tables(engine: Engine, path: Path) -> None:
    with engine.begin() as to:
        if _version(to, path) < SCHEMA:
            to.exec_driver_sql("BEGIN IMMEDIATE")  # two processes may come to a new file at once: one makes its tables
            version = _version(to, path)
            metadata.create_all(to)
            for statement in (each for old in range(version or SCHEMA, SCHEMA) for each in MIGRATIONS[old]):
                to.execute(text(statement))
            to.execute(text(f"PRAGMA user_version = {SCHEMA:d}"))


def _version(to: Connection, path: Path) -> int:
    """Of the file's tables; 0 where there are none. Raises RecordError for those of a newer program."""
    version = int(to.execute(text("PRAGMA user_version")).scalar_one())
    if version > SCHEMA:
        raise RecordError(
            f"{path}: written by a newer version of this program (schema {version}, this one knows {SCHEMA}); "
            "update the program, or name another folder in RIG_HOME"
        )
    return version
