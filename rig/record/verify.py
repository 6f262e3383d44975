"""Whether the lab still holds of every run what had arrived: its digest, computed again from the rows themselves."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import select

from rig.record.content import digest
from rig.record.schema import arrivals
from rig.record.store import Record


@dataclass(frozen=True)
class Verified:
    """Names of runs in the lab. Those on their way are not shown to readers; the rig's next push goes on with them."""

    sound: tuple[str, ...]
    on_their_way: tuple[str, ...]
    changed: tuple[str, ...]


def verify(lab: Record) -> Verified:
    """Every run that came by a push; each has a uid of its own, so none is there twice. Raises LabAway."""
    with lab.engine.connect() as at:
        rows = at.execute(select(arrivals.c.run, arrivals.c.digest).order_by(arrivals.c.run)).all()
        found = {row.run: digest(at, row.run) == row.digest for row in rows if row.digest is not None}
    sound, changed = (tuple(run for run, is_sound in found.items() if is_sound is wanted) for wanted in (True, False))
    return Verified(sound, tuple(row.run for row in rows if row.digest is None), changed)
