"""Pushing: finished runs of a rig's record into the lab's, each whole or not yet to be seen, and never twice.

A run is known by its uid. Its rows go over in batches of about MOST_BYTES, each a transaction that first locks the
run's arrival and counts what is there; so whoever comes next, after a cut or at the same time, goes on where the last
committed batch ended. The last transaction computes the digest of all that is there, in the lab, and only where it is
that of the rig's own record is the run shown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from sqlalchemy import Connection, Table, insert, select, update

from rig.errors import RecordError
from rig.record.content import count, digest, head, rows_of, run_row, uid_of
from rig.record.dialects import is_new
from rig.record.schema import arrivals, poses, runs
from rig.record.store import Record, now

MOST_BYTES = 4 << 20  # of a batch: what a cut costs, and what is in memory
ROW_BYTES = 200  # of a row beside its texts and samples, about
FINISHED = "complete"


@dataclass(frozen=True)
class Pushed:
    """A run of the rig, and what it is called in the lab: its own name, but where another rig's run has that."""

    run: str
    name: str
    how: Literal["pushed", "there"]
    digest: str


@dataclass(frozen=True)
class _Parcel:
    """A finished run as it is here: its row without names, and its digests."""

    run: str
    uid: str
    row: Mapping[str, Any]
    head: str
    digest: str


def unsent(own: Record, lab: Record, named: Sequence[str] = ()) -> list[str]:
    """The finished runs that the lab does not have as they are here, oldest first; of those that are named, if any.

    Raises UnknownRun, RecordError for a named run that is not finished, LabAway.
    """
    finished = named or [run.run for run in reversed(own.runs()) if run.state == FINISHED]
    for run in named:
        _require_finished(own, run)
    with own.engine.connect() as at:
        heads = {run: (uid_of(at, run), head(at, run)) for run in finished}
    with lab.engine.connect() as at:
        there = {row.uid: row.head for row in at.execute(select(arrivals.c.uid, arrivals.c.head))}
    return [run for run, (uid, here) in heads.items() if there.get(uid) != here]


def push(own: Record, lab: Record, run: str) -> Pushed:
    """Bring a finished run over, or what of it is not there yet. Raises LabAway, and then the next push goes on.

    Raises RecordError where the lab's copy was changed in the lab, which stays as it is.
    """
    _require_finished(own, run)
    with own.engine.connect() as at:
        parcel = _Parcel(run, uid_of(at, run), dict(run_row(at, run)._mapping), head(at, run), digest(at, run))
        done = None
        while done is None:
            with lab.engine.begin() as to:
                done = _step(at, to, parcel)
    return done


def _require_finished(own: Record, run: str) -> None:
    if (state := own.run(run).state) != FINISHED:
        raise RecordError(f"run {run} is {state}: only complete runs are pushed; `rig resume {run}` goes on with it")


def _step(at: Connection, to: Connection, parcel: _Parcel) -> Pushed | None:
    """The next batch, out of the rig's record `at` into the lab's `to`; None while more is to come."""
    name, arrived = _arrival(to, parcel)
    if arrived == parcel.head:
        return Pushed(parcel.run, name, "there", parcel.digest)
    if not _filled(at, to, parcel.run, name):
        return None
    _seal(at, to, parcel, name)
    return Pushed(parcel.run, name, "pushed", parcel.digest)


def _arrival(to: Connection, parcel: _Parcel) -> tuple[str, str | None]:
    """The run's name in the lab, and the head with which it has arrived; locked until the transaction ends."""
    mine = select(arrivals.c.run, arrivals.c.head).where(arrivals.c.uid == parcel.uid).with_for_update()
    for name in (parcel.run, f"{parcel.run}-{parcel.uid[:8]}"):  # the second where another rig's run has the first
        if (row := to.execute(mine).one_or_none()) is not None:
            return row.run, row.head
        values = {**parcel.row, "run": name, "uid": parcel.uid}
        if is_new(to, runs, values):
            to.execute(insert(arrivals), {"uid": parcel.uid, "run": name, "at": now()})
            return name, None
    raise RecordError(f"run {parcel.run}: the lab has two other runs of that name")


def _filled(at: Connection, to: Connection, run: str, name: str) -> bool:
    """Add a batch of rows to those that are there; whether that were all."""
    left = MOST_BYTES
    for table, there in count(to, name).items():
        rows, size = _next(at, table, run, there, left)
        if rows:
            to.execute(insert(table), [{**row, "run": name} for row in rows])
        left -= size
        if left <= 0:
            return False
    return True


def _next(at: Connection, table: Table, run: str, there: int, most: int) -> tuple[list[Mapping[str, Any]], int]:
    """Rows of a run after the first `there`, as many as it takes to come to `most` bytes; and how many these are."""
    rows: list[Mapping[str, Any]] = []
    size = 0
    with at.execute(rows_of(table, run).offset(there)) as found:
        for row in found.mappings():
            rows.append(dict(row))
            size += ROW_BYTES + sum(len(value) for value in row.values() if isinstance(value, str | bytes))
            if size >= most:
                break
    return rows, size


def _seal(at: Connection, to: Connection, parcel: _Parcel, name: str) -> None:
    """What may have changed since the run was first pushed; then the proof that all is there, and the run is shown."""
    to.execute(update(runs).where(runs.c.run == name).values(dict(parcel.row)))
    excluded = poses.c.excluded.is_not(None)
    to.execute(update(poses).where(poses.c.run == name, excluded).values(excluded=None))
    for row in at.execute(select(poses.c.number, poses.c.excluded).where(poses.c.run == parcel.run, excluded)):
        one = (poses.c.run == name) & (poses.c.number == row.number)
        to.execute(update(poses).where(one).values(excluded=row.excluded))
    if digest(to, name) != parcel.digest:
        raise RecordError(
            f"run {parcel.run}: what the lab would hold is not what this rig holds, so nothing was replaced; it was "
            "changed in the lab, or here meanwhile: then push it again"
        )
    sealed = {"head": parcel.head, "digest": parcel.digest, "at": now()}
    to.execute(update(arrivals).where(arrivals.c.uid == parcel.uid).values(sealed))
