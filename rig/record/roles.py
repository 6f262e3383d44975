"""Preparing a database as the lab's record: its tables, and the two roles that all others are members of."""

from __future__ import annotations

from sqlalchemy import URL, Connection, text

from rig.record.lab_url import shown
from rig.record.schema import MIGRATIONS, SCHEMA, metadata
from rig.record.server import connected, require_current, version

READER, WRITER = "rig_reader", "rig_writer"
ONE_AT_A_TIME = 0x52494700  # an advisory lock: two who prepare at once do so one after the other
MAY = {READER: "SELECT", WRITER: "SELECT, INSERT, UPDATE"}  # a row that has arrived is never deleted


def prepare(url: URL) -> int:
    """Make the tables, or bring them up to date, and give the roles what they may; the version before, 0 for none.

    What is there stays, so it can be done again. Raises LabAway; RecordError where the role in `url` may not, or the
    record is of a newer program.
    """
    engine = connected(url)
    try:
        with engine.begin() as to:
            to.execute(text(f"SELECT pg_advisory_xact_lock({ONE_AT_A_TIME})"))
            before = version(to)
            if before > SCHEMA:
                require_current(before, shown(url))
            metadata.create_all(to)
            for statement in (each for old in range(before or SCHEMA, SCHEMA) for each in MIGRATIONS[old]):
                to.execute(text(statement))
            to.execute(text(f"COMMENT ON TABLE runs IS 'schema {SCHEMA:d}'"))
            _grant(to)
    finally:
        engine.dispose()
    return before


def _grant(to: Connection) -> None:
    tables = ", ".join(to.dialect.identifier_preparer.format_table(table) for table in metadata.sorted_tables)
    for role, may in MAY.items():
        if not to.execute(text("SELECT 1 FROM pg_roles WHERE rolname = :role"), {"role": role}).scalar():
            to.execute(text(f"CREATE ROLE {role} NOLOGIN"))
        to.execute(text(f"GRANT {may} ON {tables} TO {role}"))
    to.execute(text(f"GRANT USAGE ON SEQUENCE events_event_seq, log_line_seq TO {WRITER}"))
