"""DATA of a command: a file, or a run of the record, as one table."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from calibrations.errors import DataError
from calibrations.importing.foreign import drop_duplicate_rows, read_csv
from calibrations.importing.raw_logs import average_raw_log
from calibrations.table import Table
from rig.errors import RecordError, UnknownRun

EXCLUDED = "excluded"
FOLLOWED = ("temperature_c", "supply_v")  # columns that an output may follow
BESIDE = ("t_s", *FOLLOWED, "n", "direction", "path")  # columns that are not channels


def averaged(log: Table, tell: Callable[[str], None]) -> Table:
    """The table itself, or the means of what a raw log holds still, which `tell` is then told.

    Rows that are there twice count once. Raises DataError where nothing holds still.
    """
    table = average_raw_log(log)
    if table is not log:
        tell(f"{log.source} is a log of raw samples: {_taken(table)}, out of {log.n} samples, are taken.")
    table, copies = drop_duplicate_rows(table)
    if copies is not None:
        tell(copies)
    return _included(table, tell)


def _taken(table: Table) -> str:
    return table.type.taken.format(table.n)


def _included(table: Table, tell: Callable[[str], None]) -> Table:
    """The table without the rows that its column `excluded` leaves out; a run has `rig exclude` for that."""
    out = table.optional(EXCLUDED, 0.0) != 0
    if not out.any():
        return table
    tell(f"{table.source}: {np.count_nonzero(out)} of {table.n} rows are left out, by its column `{EXCLUDED}`.")
    if out.all():
        raise DataError(
            f"{table.source}: every row is left out, by its column `{EXCLUDED}`; put 0 where a row is to count"
        )
    return table.rows(~out)


def load(data: str, kind: str | None = None, tell: Callable[[str], None] = lambda _: None) -> Table:
    """The table that `data` names. A file of that name is preferred to a run. `tell` hears what is done to a raw log.

    Raises DataError naming file, line and column; UnknownRun naming the nearest run.
    """
    if Path(data).is_dir():
        raise DataError(f"{data}: is a folder; name a file in it, or a run (`rig runs` lists them)")
    if Path(data).is_file():
        return averaged(read_csv(Path(data), kind), tell)
    table = _of_run(data)
    if kind is not None and table.kind != kind:
        raise RecordError(f"run {data} is a table of {table.kind}, not of {kind}")
    return table


def _of_run(data: str) -> Table:
    from rig.record.measured import table_of
    from rig.record.store import Record  # a file needs no database

    try:
        with Record.to_find(data) as record:
            return table_of(record, data)
    except UnknownRun as error:
        raise UnknownRun(f"{data}: there is no such file, and {error}") from None
