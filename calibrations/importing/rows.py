"""Rows of a table that a file repeats, and rows whose clock starts again."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from calibrations.table import Array, Table

MOST_ROWS_LISTED = 3
FEWEST_BETWEEN_RESTARTS = 12  # rows: in shorter parts the rows of a file are in no order of time


def sort_out_rows(table: Table) -> tuple[Table, list[str]]:
    """The table with each reading once and with one clock, and remarks on what that changed."""
    table, copies = drop_duplicate_rows(table)
    table, restart = _with_one_clock(table)
    return table, [remark for remark in (copies, restart) if remark is not None]


def drop_duplicate_rows(table: Table) -> tuple[Table, str | None]:
    """The table without rows that equal an earlier row in every number, time included; and a message that lists them.

    A repeated pose has another time and another reading. Without times, equal rows may be real repetitions: they
    stay.
    """
    if "t_s" not in table:
        return table, None
    among = _rows_at_shared_times(table.column("t_s"))
    if not len(among):
        return table, None
    rows = np.column_stack([values[among] for values in table.columns.values()])
    _, first, group = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    copies = np.setdiff1d(np.arange(len(among)), first)
    if not len(copies):
        return table, None
    earlier = among[first[group.ravel()]]
    pairs = [f"{among[k] + 1} (as {earlier[k] + 1})" for k in copies[:MOST_ROWS_LISTED]]
    rest_words = f" and {len(copies) - MOST_ROWS_LISTED} more" if len(copies) > MOST_ROWS_LISTED else ""
    verb = "copies an earlier row" if len(copies) == 1 else "copy earlier rows"
    rows_said = f"row{'s' if len(copies) > 1 else ''} {', '.join(pairs)}{rest_words}"
    return table.rows(np.delete(np.arange(table.n), among[copies])), (
        f"{table.source}: {rows_said} {verb} (same time, same values); each is used once."
    )


def _rows_at_shared_times(t_s: Array) -> NDArray[np.intp]:
    """Numbers of the rows whose time another row has too."""
    order = np.argsort(t_s, kind="stable")
    is_same = np.diff(t_s[order]) == 0
    is_shared = np.zeros(len(t_s), dtype=bool)
    is_shared[order[1:]] = is_same
    is_shared[order[:-1]] |= is_same
    return np.flatnonzero(is_shared)


def _with_one_clock(table: Table) -> tuple[Table, str | None]:
    """The table with times that continue where the clock starts again, and a message that names the first such row.

    A clock that counts from power-on starts again when the sensor is switched on again. Without this, rows of several
    days would be mixed in order of time. Parts of a file that only stand in another order are not such rows: their
    times do not overlap.
    """
    if "t_s" not in table or table.type.moving or table.type.overlapping:
        return table, None
    t_s = table.column("t_s")
    begins = np.flatnonzero(np.diff(t_s) < 0) + 1
    parts = np.split(t_s, begins)
    if not len(begins) or min(map(len, parts)) < FEWEST_BETWEEN_RESTARTS:
        return table, None
    if any(later[-1] < earlier[0] for earlier, later in pairwise(parts)):
        return table, None
    continued = parts[:1]
    for part in parts[1:]:
        continued.append(part - part[0] + continued[-1][-1] + float(np.median(np.diff(part))))
    return replace(table, columns={**table.columns, "t_s": np.concatenate(continued)}), (
        f"{table.source}: t_s starts again at row {begins[0] + 1}. The rows from there on are taken as measured "
        "directly after the rows before; if they are of another sensor, separate the file."
    )
