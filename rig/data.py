"""DATA of a command: a file, or a run of the record, as one table."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from calibrations.errors import DataError
from calibrations.read_csv import read_csv
from calibrations.stills import is_raw_log, positions
from calibrations.table import Table
from rig.errors import RecordError, UnknownRun


def still_positions(table: Table) -> Table:
    """The table itself, or the still positions in it where it is a raw log. Raises DataError where there are none."""
    if not is_raw_log(table):
        return table
    by_time = "t_s" in table and np.ptp(table.time_s) > 0
    rate_hz = (table.n - 1) / float(np.ptp(table.time_s)) if by_time else table.number("sample_rate_hz", 0.0)
    if not rate_hz > 0:
        needed = "the column t_s, or a line such as `# sample_rate_hz: 100` above its header"
        raise DataError(f"{table.source}: a raw log needs {needed}")
    return positions(table, rate_hz)


def load(data: str, kind: str | None = None) -> Table:
    """The table that `data` names. A file of that name is preferred to a run.

    Raises DataError naming file, line and column; UnknownRun naming the nearest run.
    """
    if Path(data).is_dir():
        raise DataError(f"{data}: is a folder; name a file in it, or a run (`rig runs` lists them)")
    if Path(data).is_file():
        return still_positions(read_csv(Path(data), kind))
    from rig.record import Record  # a file needs no database
    from rig.record.tables import table_of

    with Record() as record:
        try:
            table = table_of(record, data)
        except UnknownRun as error:
            raise UnknownRun(f"{data}: there is no such file, and {error}") from None
    if kind is not None and table.kind != kind:
        raise RecordError(f"run {data} is a table of {table.kind}, not of {kind}")
    return table
