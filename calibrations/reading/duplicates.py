"""Rows that stand in a table twice: a reading copied, not a reading repeated."""

from __future__ import annotations

import numpy as np

from calibrations.table import Table

SHOWN = 3


def without_copies(table: Table) -> tuple[Table, str | None]:
    """The table without rows that agree with an earlier one in every number, the time among them; and which they were.

    A pose measured again has another time and another reading. Without a time equal rows may be repetitions, read to
    few digits: they stay.
    """
    if "t_s" not in table:
        return table, None
    rows = np.column_stack(list(table.columns.values()))
    _, first, which = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    copies = np.setdiff1d(np.arange(table.n), first)
    if not len(copies):
        return table, None
    pairs = [f"{row + 1} (as {first[which.ravel()[row]] + 1})" for row in copies[:SHOWN]]
    more = f" and {len(copies) - SHOWN} more" if len(copies) > SHOWN else ""
    what = "is a copy of an earlier one and counts" if len(copies) == 1 else "are copies of earlier ones and count"
    rows_said = f"row{'s' if len(copies) > 1 else ''} {', '.join(pairs)}{more}"
    return table.rows(np.sort(first)), (
        f"{table.source}: {rows_said} {what} once: the same to the last digit and at the same time."
    )
