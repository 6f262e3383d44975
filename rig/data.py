"""DATA of a command: a file, or a run of the record, as one table."""

from __future__ import annotations

from pathlib import Path

from calibrations.read_csv import read_csv
from calibrations.table import Table
from rig.errors import RecordError, UnknownRun


def load(data: str, kind: str | None = None) -> Table:
    """The table that `data` names. A file of that name is preferred to a run.

    Raises DataError naming file, line and column; UnknownRun naming the nearest run.
    """
    if Path(data).is_file():
        return read_csv(Path(data), kind)
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
