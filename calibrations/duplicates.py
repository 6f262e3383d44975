"""Rows that stand in a table twice: a reading copied, not a reading repeated."""

from __future__ import annotations

import numpy as np

from calibrations.errors import DataError
from calibrations.table import Table

SHOWN = 3


def check_duplicates(table: Table) -> None:
    """Raises DataError for rows that agree in every number, the time among them.

    A pose measured again has another time and another reading. Without a time equal rows may be repetitions, read to
    few digits: they stay.
    """
    if "t_s" not in table:
        return
    rows = np.column_stack(list(table.columns.values()))
    _, first, which, count = np.unique(rows, axis=0, return_index=True, return_inverse=True, return_counts=True)
    again = np.setdiff1d(np.flatnonzero(count[which.ravel()] > 1), first)
    if not len(again):
        return
    pairs = [f"{row + 1} (as {first[which.ravel()[row]] + 1})" for row in again[:SHOWN]]
    more = f" and {len(again) - SHOWN} more" if len(again) > SHOWN else ""
    raise DataError(
        f"{table.source}: rows that are there twice, the same to the last digit and at the same time: row "
        f"{', '.join(pairs)}{more}; remove the copies. A pose measured twice may stay: it has a time of its own"
    )
