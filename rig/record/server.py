"""Opening the lab's record: a database of a PostgreSQL server, named by its URL.

What libpq knows beside the URL counts too: PGPASSWORD, ~/.pgpass, PGSSLROOTCERT. To another machine the connection is
encrypted, or there is none, unless somebody says another sslmode. Whatever the network or the server is to blame for is
LabAway; what a role may not do, a server that is not the right one, and a record that is not as this program needs it,
is a RecordError.
"""

from __future__ import annotations

import logging
import os

from sqlalchemy import URL, Connection, Engine, ExceptionContext, create_engine, event, text
from sqlalchemy.exc import InterfaceError, OperationalError

from rig.errors import LabAway, RecordError
from rig.record.lab_url import shown
from rig.record.schema import SCHEMA

PREPARE = "`rig push --prepare --to URL`, by the owner of the database,"
# Whoever waits for a lab that is away waits this long and no longer; a URL may say otherwise.
PATIENCE = {"connect_timeout": "5", "keepalives_idle": "10", "keepalives_interval": "5", "keepalives_count": "3"}
PATIENCE |= {"tcp_user_timeout": "20000", "application_name": "rig"}
ENCRYPTED = {"sslmode": "require"}  # where nobody says otherwise; libpq's own default would go on in plain text
HERE = ("/", "@", "127.", "localhost", "::1")  # how this machine begins; the first two are sockets of it
TLS = ("SSL", "certificate")  # what libpq speaks of where it does not get or trust an encrypted connection
FORBIDDEN, READ_ONLY = "42501", "25006"  # SQLSTATE: insufficient privilege, read-only transaction

for _name in ("psycopg", "sqlalchemy"):  # of a cut wire our message tells; their reports are for who asks for them
    logging.getLogger(_name).addHandler(logging.NullHandler())


def connected(url: URL) -> Engine:
    """The server's engine; nothing is sent yet."""
    engine = create_engine(url, connect_args=options(url))
    event.listen(engine, "handle_error", lambda context: _tell(context, url))
    return engine


def options(url: URL) -> dict[str, str]:
    """What libpq is told beside the URL, where that does not say it."""
    stated = {"service", "sslmode"} & set(url.query) or "PGSSLMODE" in os.environ or _is_here(url)
    return {k: v for k, v in PATIENCE.items() if k not in url.query} | ({} if stated else ENCRYPTED)


def _is_here(url: URL) -> bool:
    """Whether every host that is named is this machine."""
    named = url.query.get("host") or url.host or os.environ.get("PGHOST", "")
    hosts = named.split(",") if isinstance(named, str) else named
    return all(not host or host.startswith(HERE) for host in hosts)


def open_server(url: URL) -> Engine:
    """The engine of a record that has this program's tables. Raises LabAway, RecordError."""
    engine = connected(url)
    with engine.connect() as at:
        require_current(version(at), shown(url))
    return engine


def version(at: Connection) -> int:
    """Of the tables; 0 where there are none."""
    found = at.execute(text("SELECT obj_description(to_regclass('runs'), 'pg_class')")).scalar_one()
    return int(found.removeprefix("schema ")) if found else 0


def require_current(found: int, where: str) -> None:
    """Raises RecordError for tables of another version than this program's, or none."""
    if found > SCHEMA:
        raise RecordError(f"{where}: of a newer version of this program (schema {found}, this one knows {SCHEMA}); "
                          "update the program")  # fmt: skip
    if not found:
        raise RecordError(f"{where}: there is no record yet; {PREPARE} makes one")
    if found < SCHEMA:
        raise RecordError(f"{where}: of an older version (schema {found} of {SCHEMA}); {PREPARE} brings it up to date")


def _tell(context: ExceptionContext, url: URL) -> None:
    """Raises what an error of the server means here; a fault of this program stays what it is."""
    error = context.original_exception
    if getattr(error, "sqlstate", None) in (FORBIDDEN, READ_ONLY):
        role = url.username or "this role"
        raise RecordError(f"{shown(url)}: {role} may not do that ({_first_line(error)}); its owner can give it "
                          "rig_writer, or rig_reader to read alone") from None  # fmt: skip
    if context.connection is None and any(word in (said := _first_line(error)) for word in TLS):
        raise RecordError(f"{shown(url)}: no encrypted connection to a server that can be trusted ({said}); nothing "
                          "was sent. sslrootcert names the certificate of who signed the server's, and `ssl = on` in "
                          "postgresql.conf has it encrypt (docs/lab.md)") from None  # fmt: skip
    if context.is_disconnect or isinstance(context.sqlalchemy_exception, OperationalError | InterfaceError):
        raise LabAway(f"{shown(url)}: the lab's record cannot be reached ({_first_line(error)}); nothing is lost, "
                      "the next `rig push` goes on") from None  # fmt: skip
    if context.connection is None:  # what libpq does not take
        raise RecordError(f"{shown(url)}: {_first_line(error)}; put the URL right") from None


def _first_line(error: BaseException) -> str:
    return str(error).strip().partition("\n")[0].rstrip(".") or type(error).__name__
