"""Rows of the database: selections of runs, checks for changes on the disk, rows as values, replacement of a row."""

from __future__ import annotations

import secrets
import uuid
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import (
    Connection,
    Integer,
    Row,
    Select,
    String,
    cast,
    exists,
    false,
    func,
    literal_column,
    select,
    union_all,
)
from sqlalchemy import Table as SqlTable

from drivers.errors import did_you_mean
from drivers.recorder import Samples
from procedures.session import Dwell, Pose
from rig.errors import RecordError, UnknownRun
from rig.record import codec
from rig.record.checksum import is_damaged, with_checksum
from rig.record.file import RECOVER
from rig.record.schema import (
    arrivals,
    blocks,
    columns,
    dwells,
    insert_or,
    is_new,
    newest_first,
    poses,
    readings,
    runs,
    states,
)
from rig.record.values import Event, KeptPose, Run

MOST_LISTED = 5
MOST_SUGGESTED = 20  # names of a kind from which a suggestion is chosen
LAST = "last"  # the newest run, in the place of an id
POSE_COLUMNS = ("alpha_deg", "beta_deg", "direction", "path", "mount_deg", "flip", "up", "rate_deg_s")
KEPT_COLUMNS = ("t_s", "temperature_c", "alpha_read_deg", "beta_read_deg")


def select_runs() -> Select[Any]:
    """Every complete run, with the number of its rows: poses, or the values of an imported column."""
    pose_count = select(func.count()).where(poses.c.run == runs.c.run).scalar_subquery()
    imported = select(func.max(func.length(columns.c.numbers, type_=Integer) // 8)).where(columns.c.run == runs.c.run)
    on_its_way = exists().where(arrivals.c.run == runs.c.run, arrivals.c.digest.is_(None))
    return select(runs, func.coalesce(imported.scalar_subquery(), pose_count).label("rows")).where(~on_its_way)


def listed_rows(connection: Connection) -> tuple[Sequence[Row[Any]], list[str]]:
    """The rows of all runs, newest first, and the ids of runs whose poses cannot be counted.

    A damaged page hides the runs with rows on it, and no others. Raises RecordError if no run is readable.
    """
    order = newest_first(connection)
    try:
        return connection.execute(select_runs().order_by(order)).all(), []
    except RecordError as error:
        rows: list[Row[Any]] = []
        unreadable: list[str] = []
        for run in connection.execute(select(runs.c.run).order_by(order)).scalars().all():
            try:
                rows += connection.execute(select_runs().where(runs.c.run == run)).all()
            except RecordError:
                unreadable.append(run)
        if not rows:
            raise error from None
        return rows, unreadable


def select_named_rows(connection: Connection, name: str) -> Sequence[Row[Any]]:
    """The run of this id, else all whose id begins so.

    The newest one for `last`, or the newest of a procedure for `last PROCEDURE`.
    """
    last, _, procedure = name.partition(" ")
    query = select_runs().where(runs.c.run == name)
    if last == LAST:
        query = select_runs().where(runs.c.procedure == procedure) if procedure else select_runs()
        query = query.order_by(newest_first(connection)).limit(1)
    beginning = select_runs().where(runs.c.run.startswith(name, autoescape=True) if name else false())
    return connection.execute(query).all() or connection.execute(beginning).all()


def runs_of_sensor(runs: Sequence[Run], name: str) -> list[Run]:
    """The runs, in their order, of the sensor that `SENSOR`, `last SENSOR` or `last PROCEDURE SENSOR` names."""
    selector = name.removeprefix(f"{LAST} ")
    procedure, _, sensor = selector.partition(" ")
    of_procedure = [run for run in runs if run.procedure == procedure and sensor in run.sensors]
    return [run for run in runs if selector in run.sensors] or (of_procedure if selector != name else [])


def known_names(connection: Connection, name: str) -> list[str]:
    """The ids of all runs, or the procedures after `last `, oldest first: suggestions for a wrong name."""
    query = select(runs.c.procedure if name.startswith(f"{LAST} ") else runs.c.run)
    return list(dict.fromkeys(connection.execute(query).scalars()))


def several_error(matches: Sequence[Row[Any]], name: str, place: str) -> UnknownRun:
    """The error for a beginning that several ids have."""
    listed = ", ".join(sorted(row.run for row in matches)[:MOST_LISTED])
    return UnknownRun(f"{len(matches)} runs in {place} begin with {name!r}: {listed}; write more of the id")


def unknown_error(
    name: str, place: str, of_sensor: Sequence[Run], all_runs: Sequence[Run], names: list[str]
) -> UnknownRun:
    """The error for a name that several runs `of_sensor` have, or none: then with a suggestion."""
    if of_sensor:
        listed = ", ".join(run.run for run in of_sensor[:MOST_LISTED])
        return UnknownRun(
            f"{len(of_sensor)} runs in {place} are of the sensor {name!r}: {listed}"
            f"{' ...' if of_sensor[MOST_LISTED:] else ''}; write an id, or '{LAST} {name}' for the newest one"
        )
    if not all_runs:
        return UnknownRun(f"no run {name!r}: the record {place} is empty; `rig run sweep` makes a run")
    sensors = list(dict.fromkeys(sensor for run in all_runs for sensor in run.sensors))[:MOST_SUGGESTED]
    suggestion = did_you_mean(name.removeprefix(f"{LAST} "), names[-MOST_SUGGESTED:], sensors)
    return UnknownRun(f"no run {name!r} in {place}.{suggestion}")


def run_of(row: Row[Any]) -> Run:
    """The run of a row of `select_runs`."""
    return Run(**{name: value for name, value in row._mapping.items() if name != "checksum"})


def select_imported_rows(connection: Connection, run: str) -> int:
    """The number of rows of an imported table; 0 for a measured run."""
    length = func.max(func.length(columns.c.numbers, type_=Integer) // 8)
    return connection.execute(select(length).where(columns.c.run == run)).scalar_one() or 0


def excluded_rows(events: Iterable[Event]) -> dict[int, str]:
    """The reason of each excluded row of an imported table, by its number: its columns stay as they were imported."""
    reasons: dict[int, str] = {}
    for event in events:
        match event.what.split():
            case ["pose", number, "excluded"]:
                reasons[int(number)] = event.text
            case ["pose", number, "included"]:
                reasons.pop(int(number), None)
    return dict(sorted(reasons.items()))


def pose_of(row: Row[Any]) -> Pose:
    """The pose of a row of `poses`."""
    return Pose(**{name: row._mapping[poses.c[name]] for name in POSE_COLUMNS})


def has_checksums(connection: Connection, run: str) -> bool:
    """Whether every row of a run has a checksum: the entry of the run has one."""
    return connection.execute(select(runs.c.checksum).where(runs.c.run == run)).scalar_one_or_none() is not None


def require_sound(row: Row[Any], *tables: SqlTable, required: bool) -> Row[Any]:
    """The row of `tables`. Raises RecordError if it changed on the disk. `required`: it has a checksum."""
    damaged = next((table for table in tables if is_damaged(table, row._mapping, required)), None)
    if damaged is None:
        return row
    if damaged in (readings, columns):
        raise RecordError(f"{place_text(row, damaged)}; {RECOVER}")
    raise RecordError(
        f"{place_text(row, damaged)}; exclude it with `rig exclude "
        f"{row.run} {row.number} --reason damaged`, or restore a copy of the record"
    )


def place_text(row: Row[Any], table: SqlTable) -> str:
    """The part of a message that names a row which changed on the disk."""
    place = f" {table.name[:-1]} {row.name!r}" if "name" in table.c else f" pose {row.number}"
    return f"run {row.run},{place}: its values changed on the disk ({table.name})"


def require_whole(connection: Connection, run: str) -> set[int]:
    """The numbers of the poses without the excluded ones.

    Raises RecordError if a pose has no samples, if samples have no pose, or if a number occurs twice. A bit that
    changed in an index of SQLite hides rows, and no checksum of a row shows it; each table has its own index.
    """
    for number in _incomplete(connection, run):
        raise lost_pose_error(run, number)
    return set(
        connection.execute(select(poses.c.number).where(poses.c.run == run, poses.c.excluded.is_(None))).scalars()
    )


def lost_pose_error(run: str, number: int) -> RecordError:
    """The error of a pose that the record holds only in part."""
    return RecordError(f"{_lost_text(run, number)}; {RECOVER}")


def lost_rows(connection: Connection) -> list[str]:
    """A phrase for each incomplete pose of all runs."""
    run_ids = connection.execute(select(runs.c.run)).scalars().all()
    return [_lost_text(run, number) for run in run_ids for number in _incomplete(connection, run)]


def select_changed_rows(connection: Connection) -> Iterator[str]:
    """A phrase for each row that changed on the disk, except the entries of runs."""
    checked = set(connection.execute(select(runs.c.run).where(runs.c.checksum.is_not(None))).scalars())
    for table in (poses, blocks, dwells, readings, columns):
        rows = connection.execution_options(yield_per=32).execute(select(table))
        yield from (place_text(row, table) for row in rows if is_damaged(table, row._mapping, row.run in checked))


def _incomplete(connection: Connection, run: str) -> list[int]:
    """The numbers of poses that are not exactly once in both tables, without the excluded ones. One statement, so that
    a run in progress is seen at one instant.
    """
    parts = [
        select(literal_column(str(k)).label("place"), table.c.number).where(table.c.run == run)
        for k, table in enumerate((poses, blocks))
    ]
    places: tuple[list[int], list[int]] = ([], [])
    for place, number in connection.execute(union_all(*parts)):
        places[place].append(number)
    expected, sampled = map(Counter, places)
    inconsistent = {
        number for number in expected.keys() | sampled.keys() if (expected[number], sampled[number]) != (1, 1)
    }
    if not inconsistent:
        return []
    excluded = connection.execute(
        select(poses.c.number).where(poses.c.run == run, poses.c.excluded.is_not(None))
    ).scalars()
    return sorted(inconsistent - set(excluded))


def _lost_text(run: str, number: int) -> str:
    return f"run {run}, pose {number}: a part of it is lost on the disk"


def require_rows(connection: Connection, table: SqlTable, run: str) -> None:
    """Raises RecordError if the index of SQLite hides a row of a run in a small table."""
    by_index = select(func.count()).where(table.c.run == run).scalar_subquery()
    unindexed = cast(list(table.c)[2], String)  # is not in the index, so that this count reads the rows themselves
    by_table = select(func.count(unindexed)).where(table.c.run.concat("") == run).scalar_subquery()
    indexed, table_count = connection.execute(select(by_index, by_table)).one()
    if indexed != table_count:
        raise RecordError(f"run {run}: a row of its {table.name} is lost on the disk; {RECOVER}")


def damage_text(run: str, part: str = "entry") -> str:
    """The sentence about a run with a damaged entry, or with a damaged table of poses."""
    return (
        f"run {run}: its {part} is damaged; `rig doctor --recover FOLDER` copies its readable poses and the other runs"
    )


def dwell_of(row: Row[Any]) -> Dwell:
    """The dwell of a joined row of `poses` and `dwells`."""
    return Dwell(pose_of(row), row.t_s, row.means, row.stds, row.n, row.temperature_c)


def kept_of(row: Row[Any]) -> KeptPose:
    """A pose and its samples. Raises RecordError if the samples have an unknown format or cannot be decoded."""
    place = f"run {row.run}, pose {row.number}"
    if row.codec != codec.CODEC:
        raise RecordError(f"{place}: the samples have the unknown format {row.codec!r}; update the program")
    try:
        volts = codec.decode(row.samples)
    except ValueError as error:
        raise RecordError(f"{place}: {error}; restore a copy of the record") from None
    pose = pose_of(row)
    block = Samples(volts, tuple(row.channels), row.rate_hz, row.start_s)
    return KeptPose(
        pose, block, excluded=row.excluded, number=row.number, **{name: row._mapping[name] for name in KEPT_COLUMNS}
    )


def put_state(connection: Connection, run: str, state: Mapping[str, Any]) -> None:
    """Insert or replace the state of the simulated bench of a run."""
    insert_or_replace(connection, states, {"run": run, "state": dict(state)}, ("run",))


def insert_or_replace(connection: Connection, table: SqlTable, values: Mapping[str, Any], key: Sequence[str]) -> None:
    """Insert a row, or replace the one of the same key."""
    connection.execute(
        insert_or(connection, table).values(values).on_conflict_do_update(index_elements=list(key), set_=dict(values))
    )


def timestamp() -> str:
    """ISO 8601, UTC; microseconds, so that no two runs of a record begin at the same time."""
    return datetime.now(UTC).isoformat(timespec="microseconds")


def new_run(connection: Connection, values: Mapping[str, Any]) -> str:
    """Add a run. Returns its id, which sorts by time: 20261121-093012-sweep-a1b."""
    while True:
        run = f"{datetime.now(UTC):%Y%m%d-%H%M%S}-{values['procedure']}-{secrets.token_hex(2)[:3]}"
        row = {"results": {}, "identities": {}, **values, "run": run, "created": timestamp(), "uid": uuid.uuid4().hex}
        if is_new(connection, runs, with_checksum(runs, row)):
            return run  # else a run of the same second has this id
