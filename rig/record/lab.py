"""The lab's record on a PostgreSQL server: its connection and preparation."""

from __future__ import annotations

import logging
import os
import socket
import threading
from contextlib import suppress
from functools import cache
from typing import Any

from sqlalchemy import URL, Connection, Engine, ExceptionContext, create_engine, event, text
from sqlalchemy.exc import InterfaceError, OperationalError

from rig.errors import LabAway, RecordError
from rig.lab_url import mask_url
from rig.record.schema import SCHEMA, metadata, upgrade

# libpq also uses PGPASSWORD, ~/.pgpass and PGSSLROOTCERT. A connection to another machine is encrypted, unless the user
# sets another sslmode. LabAway: the network or the server fails. RecordError: a missing permission, a wrong server, or
# a record of another version.

PREPARE = "`rig push --prepare --to URL`, run by the owner of the database,"
# Timeouts for an absent lab; the URL can set others.
PATIENCE = {"connect_timeout": "5", "keepalives_idle": "10", "keepalives_interval": "5", "keepalives_count": "3"}
PATIENCE |= {"tcp_user_timeout": "20000", "application_name": "rig"}
TLS_DEFAULT = {"sslmode": "require"}  # by default; the default of libpq would fall back to plain text
LOCAL_HOSTS = ("/", "@", "127.", "localhost", "::1")  # prefixes of this machine; the first two are sockets
TLS = ("SSL", "certificate")  # words in libpq's messages on encryption
FORBIDDEN, READ_ONLY = "42501", "25006"  # SQLSTATE: insufficient privilege, read-only transaction
LOCK_NOT_AVAILABLE = "55P03"  # SQLSTATE: lock not available
SILENCE_S = 60.0  # longest wait for one answer of the server; the server may be stopped, and its network alive
LOCK_S = 15  # longest wait for another push of the same run
IDLE_S = 60  # after which the server ends the transaction of a client that is stopped, and releases its locks

for _name in ("psycopg", "sqlalchemy"):  # our own message reports a lost connection
    logging.getLogger(_name).addHandler(logging.NullHandler())


def make_engine(url: URL) -> Engine:
    """The engine of the server. It does not connect yet."""
    engine = create_engine(url, connect_args=options(url))
    event.listen(
        engine,
        "do_connect",
        lambda _dialect, _record, args, options_by_name: patient().connect(*args, **options_by_name),
    )
    event.listen(engine, "connect", lambda connection, _: _bound_locks(connection))
    event.listen(engine, "handle_error", lambda context: _raise_lab_error(context, url))
    return engine


@cache
def patient() -> Any:
    """A class of connections that end after SILENCE_S without an answer of the server; libpq would wait forever."""
    import psycopg  # only a rig with a lab needs the database driver

    class PatientConnection(psycopg.Connection[Any]):
        def wait(self, *args: Any, **options_by_name: Any) -> Any:
            silent, fileno = threading.Event(), self.pgconn.socket

            def give_up() -> None:
                silent.set()
                hang_up(fileno)

            timer = threading.Timer(SILENCE_S, give_up)
            timer.daemon = True
            timer.start()
            try:
                return super().wait(*args, **options_by_name)
            except psycopg.OperationalError:
                if silent.is_set():  # libpq reports that the server closed the connection
                    raise psycopg.OperationalError(f"no answer for {SILENCE_S:g} s") from None
                raise
            finally:
                timer.cancel()

    return PatientConnection


def hang_up(fileno: int) -> None:
    """Shut a socket down: the thread that waits for it gets an error."""
    with suppress(OSError), socket.socket(fileno=os.dup(fileno)) as wire:
        wire.shutdown(socket.SHUT_RDWR)


def _bound_locks(connection: Any) -> None:
    connection.autocommit = True
    with connection.cursor() as cursor:
        cursor.execute(f"SET lock_timeout = '{LOCK_S}s'")
        cursor.execute(f"SET idle_in_transaction_session_timeout = '{IDLE_S}s'")
    connection.autocommit = False


def options(url: URL) -> dict[str, str]:
    """The options for libpq that the URL does not set."""
    security_options = {"service", "sslmode"} & set(url.query) or "PGSSLMODE" in os.environ or _is_here(url)
    return {k: v for k, v in PATIENCE.items() if k not in url.query} | ({} if security_options else TLS_DEFAULT)


def _is_here(url: URL) -> bool:
    """Whether every host of the URL is this machine."""
    host_names = url.query.get("host") or url.host or os.environ.get("PGHOST", "")
    hosts = host_names.split(",") if isinstance(host_names, str) else host_names
    return all(not host or host.startswith(LOCAL_HOSTS) for host in hosts)


def open_server(url: URL) -> Engine:
    """The engine of a record with the tables of this program. Raises LabAway, RecordError."""
    engine = make_engine(url)
    with engine.connect() as connection:
        require_current(version(connection), mask_url(url))
    return engine


def version(connection: Connection) -> int:
    """The schema of the tables; 0 without tables."""
    comment = connection.execute(text("SELECT obj_description(to_regclass('runs'), 'pg_class')")).scalar_one()
    return int(comment.removeprefix("schema ")) if comment else 0


def require_current(schema: int, place: str) -> None:
    """Raises RecordError for tables of another version of this program, and without tables."""
    if schema > SCHEMA:
        raise RecordError(f"{place}: the record is of a newer version of this program (schema {schema}, this one knows "
                          f"{SCHEMA}); get the new version")  # fmt: skip
    if not schema:
        raise RecordError(f"{place}: there is no record yet; {PREPARE} makes one")
    if schema < SCHEMA:
        raise RecordError(f"{place}: this record has an older schema ({schema} of {SCHEMA}); {PREPARE} updates it")


def _raise_lab_error(context: ExceptionContext, url: URL) -> None:
    """Raises LabAway or RecordError for an error of the server. A defect of this program passes."""
    error = context.original_exception
    if getattr(error, "sqlstate", None) in (FORBIDDEN, READ_ONLY):
        role = url.username or "this role"
        raise RecordError(f"{mask_url(url)}: {role} has no permission for this ({_first_line(error)}); the owner can "
                          "grant it rig_writer, or rig_reader for reading") from None  # fmt: skip
    if getattr(error, "sqlstate", None) == LOCK_NOT_AVAILABLE:
        raise RecordError(
            f"{mask_url(url)}: another push has locked this run for more than {LOCK_S} s; push it again later "
            f"(the server releases the lock of a stopped program after {IDLE_S} s)"
        ) from None
    if context.connection is None and any(word in (reason := _first_line(error)) for word in TLS):
        raise RecordError(f"{mask_url(url)}: there is no encrypted connection to a trusted server ({reason}); "
                          "nothing was sent. Give the certificate of the server's signer in sslrootcert, and set "
                          "`ssl = on` in the server's postgresql.conf (docs/lab.md)") from None  # fmt: skip
    if context.is_disconnect or isinstance(context.sqlalchemy_exception, OperationalError | InterfaceError):
        raise LabAway(f"{mask_url(url)}: no connection to the lab's record ({_first_line(error)}); nothing is lost, "
                      "the next `rig push` continues") from None  # fmt: skip
    if context.connection is None:  # libpq refuses the URL
        raise RecordError(f"{mask_url(url)}: {_first_line(error)}; correct the URL") from None


def _first_line(error: BaseException) -> str:
    return str(error).strip().partition("\n")[0].rstrip(".") or type(error).__name__


# Preparation of a database as the lab's record: the tables, and two roles. All users are members of one of them.

READER, WRITER = "rig_reader", "rig_writer"
ONE_AT_A_TIME = 0x52494700  # key of the advisory lock for the preparation
PRIVILEGES = {READER: "SELECT", WRITER: "SELECT, INSERT, UPDATE"}  # rows are never deleted


def prepare(url: URL) -> int:
    """Make or migrate the tables, and grant permissions to the roles. Returns the schema before, 0 without tables.

    Existing rows stay, so it can be repeated. Raises LabAway; RecordError if the role in `url` has no permission, or
    the record belongs to a newer program.
    """
    engine = make_engine(url)
    try:
        with engine.begin() as connection:
            connection.execute(text(f"SELECT pg_advisory_xact_lock({ONE_AT_A_TIME})"))
            schema_before = version(connection)
            if schema_before > SCHEMA:
                require_current(schema_before, mask_url(url))
            upgrade(connection, schema_before)
            connection.execute(text(f"COMMENT ON TABLE runs IS 'schema {SCHEMA:d}'"))
            _grant(connection)
    finally:
        engine.dispose()
    return schema_before


def _grant(connection: Connection) -> None:
    tables = ", ".join(connection.dialect.identifier_preparer.format_table(table) for table in metadata.sorted_tables)
    for role, may in PRIVILEGES.items():
        if not connection.execute(text("SELECT 1 FROM pg_roles WHERE rolname = :role"), {"role": role}).scalar():
            connection.execute(text(f"CREATE ROLE {role} NOLOGIN"))
        connection.execute(text(f"GRANT {may} ON {tables} TO {role}"))
    connection.execute(text(f"GRANT USAGE ON SEQUENCE events_event_seq, log_line_seq TO {WRITER}"))
