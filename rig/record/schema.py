"""The tables of the record. `SCHEMA` counts their versions; it is kept in the file's `user_version`."""

from __future__ import annotations

from sqlalchemy import JSON, Column, Float, ForeignKey, Index, Integer, LargeBinary, MetaData, String, Table

SCHEMA = 6
metadata = MetaData()

runs = Table(
    "runs",
    metadata,
    Column("run", String, primary_key=True),
    Column("kind", String, nullable=False),  # of the table that its rows make: poses, positions, ...
    Column("procedure", String, nullable=False),  # "import" where a file was read
    Column("state", String, nullable=False),  # running, complete, stopped, failed
    Column("settings", JSON, nullable=False),
    Column("bench", JSON, nullable=False),  # the whole configuration, as it was
    Column("identities", JSON, nullable=False),  # of the instruments, by role
    Column("configuration", String, nullable=False),  # hash of procedure, settings and bench
    Column("constants", JSON, nullable=False),
    Column("source", String, nullable=False),
    Column("created", String, nullable=False),  # ISO 8601, UTC
    Column("ended", String),
    Column("message", String),  # why it stopped or failed
    Column("results", JSON, nullable=False),
)

poses = Table(
    "poses",
    metadata,
    Column("run", ForeignKey("runs.run"), primary_key=True),
    Column("number", Integer, primary_key=True),  # in the order of keeping, from 0
    Column("alpha_deg", Float, nullable=False),
    Column("beta_deg", Float, nullable=False),
    Column("direction", Integer, nullable=False),
    Column("path", String, nullable=False),
    Column("mount_deg", Float, nullable=False),
    Column("flip", Integer, nullable=False),
    Column("t_s", Float, nullable=False),  # middle of the dwell
    Column("temperature_c", Float),
    Column("excluded", String),  # why a person took it out of every analysis; it stays in the record
    Column("alpha_read_deg", Float),  # what the dial of a stage that is turned by hand showed
    Column("beta_read_deg", Float),
    Column("up", String, nullable=False, server_default="z"),  # the edge that stands along the table's normal
    Column("rate_deg_s", Float, nullable=False, server_default="0"),  # of beta, in a turn that was kept
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
)

blocks = Table(
    "blocks",
    metadata,
    Column("run", ForeignKey("runs.run"), primary_key=True),
    Column("number", Integer, primary_key=True),  # of the pose
    Column("rate_hz", Float, nullable=False),
    Column("start_s", Float, nullable=False),
    Column("channels", JSON, nullable=False),
    Column("codec", String, nullable=False),
    Column("samples", LargeBinary, nullable=False),
)

dwells = Table(  # what a page draws of a night without reading its samples
    "dwells",
    metadata,
    Column("run", ForeignKey("runs.run"), primary_key=True),
    Column("number", Integer, primary_key=True),  # of the pose
    Column("n", Integer, nullable=False),  # samples
    Column("means", JSON, nullable=False),  # V, by channel
    Column("stds", JSON, nullable=False),
)

columns = Table(  # of imported tables
    "columns",
    metadata,
    Column("run", ForeignKey("runs.run"), primary_key=True),
    Column("name", String, primary_key=True),
    Column("position", Integer, nullable=False),
    Column("numbers", LargeBinary),  # float64, little-endian
    Column("texts", JSON),
)

states = Table(  # of a simulated bench after the last kept pose: clock, world, twins
    "states",
    metadata,
    Column("run", ForeignKey("runs.run"), primary_key=True),
    Column("state", JSON, nullable=False),
)

events = Table(
    "events",
    metadata,
    Column("event", Integer, primary_key=True),
    Column("run", ForeignKey("runs.run"), nullable=False),
    Column("at", String, nullable=False),  # ISO 8601, UTC
    Column("what", String, nullable=False),
    Column("text", String, nullable=False),
    Index("events_of_run", "run"),
)

log = Table(  # of what happened in a run, step by step; and of messages on the wires, where they were asked for
    "log",
    metadata,
    Column("line", Integer, primary_key=True),
    Column("run", ForeignKey("runs.run"), nullable=False),
    Column("at", String, nullable=False),  # ISO 8601, UTC
    Column("clock_s", Float, nullable=False),  # of the rig: simulated time on a simulated bench
    Column("who", String, nullable=False),  # the run, or an instrument's role
    Column("what", String, nullable=False),  # doing, kept, read, sent, heard, error, ...
    Column("text", String, nullable=False),
    Index("log_of_run", "run"),
)

# What brings an older file to the next version. Tables that are wholly new are made before.
MIGRATIONS = {
    1: ("ALTER TABLE poses ADD COLUMN excluded VARCHAR",),
    2: tuple(f"ALTER TABLE poses ADD COLUMN {role}_read_deg FLOAT" for role in ("alpha", "beta")),
    3: (
        "ALTER TABLE poses ADD COLUMN up VARCHAR NOT NULL DEFAULT 'z'",
        "ALTER TABLE poses ADD COLUMN rate_deg_s FLOAT NOT NULL DEFAULT 0",
    ),
    4: (),  # a new table
    5: (),  # a new table
}
