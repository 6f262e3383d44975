"""Pushes finished runs into the lab's record, and verifies them there.

A run is pushed completely, exactly once, and is not visible before it is complete. Its rows are sent in batches of
about MOST_BYTES. Each batch is a transaction that locks the run's row in `arrivals` and counts the rows in the lab. So
another push, after an interruption or at the same time, continues after the last committed batch. The last transaction
computes the digest of all rows in the lab. The run becomes visible if it is equal to the digest of the rig's record.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from sqlalchemy import Connection, Table, insert, select, update

from rig.bench import Lab
from rig.errors import LabAway, RecordError
from rig.lab_url import lab_url
from rig.record.content import count, digest, head, rows_of, run_row, uid_of
from rig.record.rows import timestamp
from rig.record.schema import arrivals, is_new, poses, runs
from rig.record.store import Record
from rig.record.values import Run


def push_after(record: Record, run: Run, lab: Lab | None, notify: Callable[[str], None]) -> None:
    """After a complete `run`, push all finished runs that are not in the lab. `notify` gets a message for each.

    A failure of the lab does not affect the run.
    """
    if lab is None or not lab.push or run.state != "complete":
        return
    try:
        with Record(lab_url(lab.url)) as lab_record:
            for pushed in push_all(record, lab_record, unsent(record, lab_record)):
                notify(
                    str(pushed) if isinstance(pushed, RecordError) else f"{pushed.run}: pushed to {lab_record.where}"
                )
    except RecordError as error:
        notify(f"not pushed: {error}")


MOST_BYTES = 4 << 20  # of a batch: lost by an interruption, and held in memory
ROW_BYTES = 200  # of a row without its texts and samples, about
FINISHED = "complete"


@dataclass(frozen=True)
class PushedRun:
    """A run of the rig, and its name in the lab, which is different if a run of another rig has its name."""

    run: str
    name: str
    how: Literal["pushed", "there"]
    digest: str


@dataclass(frozen=True)
class _Parcel:
    """A finished run of the rig: its row without names, and its digests."""

    run: str
    uid: str
    row: Mapping[str, Any]
    head: str
    digest: str


def unsent(local: Record, lab: Record, run_names: Sequence[str] = ()) -> list[str]:
    """The finished runs that are missing or different in the lab, oldest first; only the `run_names` ones, if any.

    Raises UnknownRun, RecordError for an unfinished named run, LabAway.
    """
    finished = [local.run(name).run for name in run_names]
    for run in finished:
        _require_finished(local, run)
    finished = finished or [run.run for run in reversed(local.runs()) if run.state == FINISHED]
    with local.engine.connect() as source:
        heads = {run: (uid_of(source, run), head(source, run)) for run in finished}
    with lab.engine.connect() as source:
        lab_heads = {row.uid: row.head for row in source.execute(select(arrivals.c.uid, arrivals.c.head))}
    return [run for run, (uid, local_head) in heads.items() if lab_heads.get(uid) != local_head]


def push_all(local: Record, lab: Record, run_names: Sequence[str]) -> Iterator[PushedRun | RecordError]:
    """Push each run. A run that the lab refuses does not hinder the others. Raises LabAway."""
    for run in run_names:
        try:
            yield push(local, lab, run)
        except LabAway:
            raise
        except RecordError as error:
            yield RecordError(f"run {run} is not pushed: {error}")


def push(local: Record, lab: Record, run: str) -> PushedRun:
    """Push the missing rows of a finished run. Raises LabAway; then the next push continues.

    Raises RecordError if the copy in the lab was changed there. The copy stays unchanged.
    """
    _require_finished(local, run)
    with local.engine.connect() as source:
        row = {
            **run_row(source, run)._mapping,
            "checksum": source.scalar(select(runs.c.checksum).where(runs.c.run == run)),
        }
        parcel = _Parcel(run, uid_of(source, run), row, head(source, run), digest(source, run))
        pushed = None
        while pushed is None:
            with lab.engine.begin() as target:
                pushed = _step(source, target, parcel)
    return pushed


def _require_finished(local: Record, run: str) -> None:
    if (state := local.run(run).state) != FINISHED:
        raise RecordError(f"run {run} is {state}, and only complete runs are pushed; `rig resume {run}` continues it")


def _step(source: Connection, target: Connection, parcel: _Parcel) -> PushedRun | None:
    """Push the next batch from the rig's record `source` to the lab's `target`. Returns None if there are more."""
    name, arrived = _arrival(target, parcel)
    if arrived == parcel.head:
        return PushedRun(parcel.run, name, "there", parcel.digest)
    if not _fill(source, target, parcel.run, name):
        return None
    _seal(source, target, parcel, name)
    return PushedRun(parcel.run, name, "pushed", parcel.digest)


def _arrival(target: Connection, parcel: _Parcel) -> tuple[str, str | None]:
    """The name of the run in the lab, and its head there; locked until the end of the transaction."""
    arrival_query = select(arrivals.c.run, arrivals.c.head).where(arrivals.c.uid == parcel.uid).with_for_update()
    for name in (parcel.run, f"{parcel.run}-{parcel.uid[:8]}"):  # the second if a run of another rig has the first
        if (row := target.execute(arrival_query).one_or_none()) is not None:
            return row.run, row.head
        values = {**parcel.row, "run": name, "uid": parcel.uid}
        if is_new(target, runs, values):
            target.execute(insert(arrivals), {"uid": parcel.uid, "run": name, "at": timestamp()})
            return name, None
    raise RecordError(f"run {parcel.run}: the lab has two other runs with this name; ask the owner of the lab's record")


def _fill(source: Connection, target: Connection, run: str, name: str) -> bool:
    """Add a batch of rows. Returns whether all rows are in the lab."""
    remaining = MOST_BYTES
    for table, present in count(target, name).items():
        rows, size = _next(source, table, run, present, remaining)
        if rows:
            target.execute(insert(table), [{**row, "run": name} for row in rows])
        remaining -= size
        if remaining <= 0:
            return False
    return True


def _next(source: Connection, table: Table, run: str, present: int, most: int) -> tuple[list[Mapping[str, Any]], int]:
    """Rows of a run after the first `present`, up to about `most` bytes; and their size in bytes."""
    rows: list[Mapping[str, Any]] = []
    size = 0
    with source.execute(rows_of(table, run).offset(present)) as result:
        for row in result.mappings():
            rows.append(dict(row))
            size += ROW_BYTES + sum(len(value) for value in row.values() if isinstance(value, str | bytes))
            if size >= most:
                break
    return rows, size


def _seal(source: Connection, target: Connection, parcel: _Parcel, name: str) -> None:
    """Update the parts that can change, compare the digests, and make the run visible."""
    target.execute(update(runs).where(runs.c.run == name).values(dict(parcel.row)))
    excluded = poses.c.excluded.is_not(None)
    target.execute(update(poses).where(poses.c.run == name, excluded).values(excluded=None))
    for row in source.execute(select(poses.c.number, poses.c.excluded).where(poses.c.run == parcel.run, excluded)):
        is_pose = (poses.c.run == name) & (poses.c.number == row.number)
        target.execute(update(poses).where(is_pose).values(excluded=row.excluded))
    if digest(target, name) != parcel.digest:
        raise RecordError(
            f"run {parcel.run}: the copy in the lab is different from the run of this rig, so nothing was replaced; if "
            "the run has just changed here, push it again; else the copy was changed in the lab"
        )
    sealed = {"head": parcel.head, "digest": parcel.digest, "at": timestamp()}
    target.execute(update(arrivals).where(arrivals.c.uid == parcel.uid).values(sealed))


@dataclass(frozen=True)
class Verification:
    """Names of runs in the lab. Readers do not see those on their way; the next push of the rig continues them."""

    sound: tuple[str, ...]
    on_their_way: tuple[str, ...]
    changed: tuple[str, ...]


def verify(lab: Record) -> Verification:
    """Compute the digest of every pushed run again, and compare it with the digest at its arrival. Raises LabAway."""
    with lab.engine.connect() as source:
        rows = source.execute(select(arrivals.c.run, arrivals.c.digest).order_by(arrivals.c.run)).all()
        arrived = {row.run: digest(source, row.run) == row.digest for row in rows if row.digest is not None}
    return Verification(
        sound=tuple(run for run, unchanged in arrived.items() if unchanged),
        on_their_way=tuple(row.run for row in rows if row.digest is None),
        changed=tuple(run for run, unchanged in arrived.items() if not unchanged),
    )
