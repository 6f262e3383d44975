"""Several runs or files of one sensor as one table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from calibrations.errors import DataError
from calibrations.joined import clock_began_anew, joined
from calibrations.table import Table
from rig.errors import UnknownRun
from rig.services.data import load

if TYPE_CHECKING:
    from rig.record.store import Record


def load_all(names: Sequence[str], tell: Callable[[str], None] = lambda _: None) -> Table:
    """The tables that `names` name, joined. Raises what `load` and `joined` raise."""
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise DataError(f"{twice} is named twice; the same data counts once")
    tables = [load(name, tell=tell) for name in names]
    if len(tables) == 1:
        return tables[0]
    return joined_runs(tables, [_begun(name) for name in names], tell)


def joined_runs(
    tables: Sequence[Table], begun: Sequence[datetime | None], tell: Callable[[str], None] = lambda _: None
) -> Table:
    """The tables of runs joined; times count from the beginning of the first, where all say when they were `begun`."""
    known = [at for at in begun if at is not None]
    if len(known) == len(tables):
        tables = [_later(t, (at - known[0]).total_seconds()) for t, at in zip(tables, known, strict=True)]
    if clock_began_anew(tables):
        tell("The clocks of these began anew: they are taken as if one had followed the other at once.")
    return joined(tables)


def _begun(name: str) -> datetime | None:
    """When a run began whose times count from then: one on real instruments."""
    if Path(name).is_file():
        return None
    from rig.record.store import Record

    with suppress(UnknownRun), Record.to_find(name) as record:
        return begun(record, name.partition("/")[0])
    return None


def begun(record: Record, run: str) -> datetime | None:
    """When a run of the record began; None on a simulated bench, whose times count from when its sensor was powered."""
    from rig.bench import Bench

    found = record.run(run)
    simulated = found.bench.get("instruments") and Bench.model_validate(found.bench).simulated
    return None if simulated else datetime.fromisoformat(found.created)


def _later(table: Table, by_s: float) -> Table:
    if "t_s" not in table:
        return table
    return replace(table, columns=MappingProxyType({**table.columns, "t_s": table.column("t_s") + by_s}))
