"""Opens the record's file: one SQLite database that survives a kill.

With the write-ahead log and synchronous=FULL a committed transaction is on the disk. A failure of the disk, the folder
or the file is a RecordError, now or later.

If another program removes the write-ahead log or its index, SQLite continues to write into the removed file, and its
rows would be lost without an error. So the identities of both files are compared before and after each transaction.
The connection still has the removed file: it copies all rows from there into the record, and a new connection goes on.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine, ExceptionContext, create_engine, event, text
from sqlalchemy.exc import InvalidatePoolError

from rig.errors import RecordError
from rig.record.schema import SCHEMA, give_sha256, upgrade

FILE = "record.db"
RECOVER = "move it to another folder, or copy its readable rows with `rig doctor --recover FOLDER`"
FAILURES = {  # primary code of SQLite: fault and remedy
    sqlite3.SQLITE_FULL: "cannot be written: the disk is full; free some space, then try again; "
    "`rig resume` continues a run",
    sqlite3.SQLITE_READONLY: "cannot be written: it is read-only; make file and folder writable, or set RIG_HOME to "
    "another folder",
    sqlite3.SQLITE_IOERR: "cannot be read or written: the file system fails; check the disk or the network share, "
    "then continue with `rig resume`",
    sqlite3.SQLITE_CANTOPEN: "cannot be opened; check RIG_HOME and the permissions of the folder",
    sqlite3.SQLITE_BUSY: "another process is writing to it; wait until it ends, then try again",
    sqlite3.SQLITE_CORRUPT: f"the record is damaged; {RECOVER}",
    sqlite3.SQLITE_NOTADB: f"the record is damaged, or the file is not a record; {RECOVER}",
}


LOG_SUFFIXES = ("-wal", "-shm")  # of the record's file: write-ahead log, and its index
REMOVED_LOG = "another program removed the write-ahead log of the record during this command"


def open_file(path: Path, notify: Callable[[str], None] = lambda _: None) -> Engine:
    """The engine of the file. Missing tables are made, old tables are migrated.

    In a folder without write permission the file is opened read-only. Raises RecordError if the file cannot be opened,
    is damaged, or belongs to a newer program. Later use of the engine raises it as well. `notify` gets a message if the
    write-ahead log was removed.
    """
    engine = create_engine(f"sqlite:///{path}", creator=lambda: _connect(path))
    event.listen(engine, "connect", lambda connection, _: give_sha256(connection))
    event.listen(engine, "connect", lambda _, info: info.info.update(sides=_log_inodes(path), inode=_inode(path)))
    event.listen(engine, "checkout", lambda connection, info, _: _require_log(connection, info.info, path, notify))
    event.listen(engine, "checkin", lambda connection, info: _save_rows(connection, info.info, path, notify))
    event.listen(engine, "close", lambda connection, info: _save_rows(connection, info.info, path, notify))
    event.listen(engine, "handle_error", lambda context: _raise_record_error(context, path))
    event.listen(engine, "begin", lambda connection: _require_file(connection, path))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordError(f"{path}: cannot open the record: {error.strerror}; check RIG_HOME") from None
    _make_tables(engine, path)
    return engine


def _connect(path: Path) -> sqlite3.Connection:
    """A new connection. It waits for a busy file, and a commit reaches the disk."""
    if path.exists() and not os.access(path.parent, os.W_OK):
        connection = sqlite3.connect(
            f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True, check_same_thread=False
        )
        connection.text_factory = decode_text
        return connection
    connection = sqlite3.connect(path, check_same_thread=False)
    connection.text_factory = decode_text
    try:
        _prepare(connection)
    except (UnicodeDecodeError, sqlite3.OperationalError) as error:  # SQLite quotes unreadable bytes
        if getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR) == sqlite3.SQLITE_ERROR:  # the file is at fault
            raise RecordError(f"{path}: {FAILURES[sqlite3.SQLITE_CORRUPT]} ({error})") from None
        raise
    return connection


def decode_text(data: bytes) -> str:
    """The text; unreadable bytes become surrogates, so that the other rows of a query stay readable."""
    return data.decode("utf-8", "surrogateescape")


def _prepare(connection: sqlite3.Connection) -> None:
    for pragma in ("busy_timeout = 10000", "journal_mode = WAL", "synchronous = FULL", "foreign_keys = ON"):
        connection.execute(f"PRAGMA {pragma}")
    connection.execute("SELECT count(*) FROM sqlite_master").fetchone()  # opens the write-ahead log


def _inode(path: Path) -> int | None:
    try:
        return path.stat().st_ino
    except OSError:
        return None


def _log_inodes(path: Path) -> tuple[int | None, ...]:
    """The identities of the write-ahead log and its index; None for a missing file."""
    return tuple(_inode(path.with_name(path.name + side)) for side in LOG_SUFFIXES)


def _require_log(connection: Any, info: dict[str, Any], path: Path, notify: Callable[[str], None]) -> None:
    """Go on with a new connection if the write-ahead log was removed. Raises RecordError if rows cannot be saved."""
    if not _save_rows(connection, info, path, notify):
        raise RecordError(f"{path}: {REMOVED_LOG}, and its rows cannot be saved; {RECOVER}")
    if info.get("replaced"):
        raise InvalidatePoolError  # the pool makes a new connection


def _save_rows(connection: Any, info: dict[str, Any], path: Path, notify: Callable[[str], None]) -> bool:
    """Copy the rows of a removed write-ahead log into the record. Returns False if that fails.

    A record that was removed or exchanged itself is found at the beginning of the next transaction.
    """
    if (
        connection is None
        or info.get("replaced")
        or _log_inodes(path) == info["sides"]
        or _inode(path) != info["inode"]
    ):
        return True
    if info["sides"][0] is None:  # read-only, or a file system without a write-ahead log
        return True
    try:
        (busy, *_) = connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
    except sqlite3.Error:
        busy = True
    info["replaced"] = not busy
    remedy = "check the poses of this run" if busy else "all rows were saved"
    notify(f"{path}: {REMOVED_LOG}; {remedy}; do not let a program remove files from this folder")
    return not busy


def _require_file(connection: Connection, path: Path) -> None:
    """Raises RecordError for a removed or exchanged file: SQLite would continue to write into the old one."""
    try:
        inode = path.stat().st_ino
    except OSError as error:
        raise RecordError(f"{path}: the record has disappeared ({error.strerror}); put its folder back") from None
    if connection.info["inode"] != inode:
        raise RecordError(f"{path}: the record was exchanged during this command; run the command again")


def _raise_record_error(context: ExceptionContext, path: Path) -> None:
    """Raises RecordError for a fault of the file or its disk."""
    error = context.original_exception
    if isinstance(error, UnicodeDecodeError):
        raise RecordError(f"{path}: {FAILURES[sqlite3.SQLITE_CORRUPT]}") from None
    if isinstance(error, sqlite3.DatabaseError):
        code = getattr(error, "sqlite_errorcode", 0) & 0xFF
        if code in FAILURES:
            raise RecordError(f"{path}: {FAILURES[code]} ({error})") from None


def _make_tables(engine: Engine, path: Path) -> None:
    with engine.begin() as connection:
        if _version(connection, path) < SCHEMA:
            connection.exec_driver_sql("BEGIN IMMEDIATE")  # of two processes at a new file only one makes the tables
            version = _version(connection, path)
            upgrade(connection, version)
            connection.execute(text(f"PRAGMA user_version = {SCHEMA:d}"))


def _version(connection: Connection, path: Path) -> int:
    """Schema of the tables; 0 without tables. Raises RecordError for tables of a newer program."""
    version = int(connection.execute(text("PRAGMA user_version")).scalar_one())
    if version > SCHEMA:
        raise RecordError(
            f"{path}: the record is of a newer version of this program (schema {version}, this one knows {SCHEMA}); "
            "get the new version, or set RIG_HOME to another folder"
        )
    return version
