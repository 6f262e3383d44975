"""Logged columns without the scatter of their readings: a sensor feels the level beneath, not the reader's noise."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from calibrations.table import Array, Table


def level(table: Table, name: str, power: int = 1) -> Array:
    """A column to a power of 1 or 2 without the scatter of its readings, shape (n,), rows in order of time.

    As logged where no time changes, as in a single row: the scatter is known from the neighbours.
    """
    if "t_s" not in table or not np.ptp(table.time_s) > 0:
        return np.asarray(table.column(name) ** power)
    return _without_scatter(table, name, power)[0]


def reading_error(table: Table, name: str, power: int = 1) -> float:
    """Rms error of that level over its rms about its mean, as the scatter of the readings leaves it."""
    values, error = _without_scatter(table, name, power)
    return error / (float(np.std(values)) or 1.0)


@lru_cache(maxsize=32)
def _without_scatter(table: Table, name: str, power: int) -> tuple[Array, float]:
    """Level and rms error, in the column's unit to the power.

    The straight line is taken off first: the cosine transform continues a record as its mirror image, and the line
    would have a corner there.
    """
    from calibrations.estimators.scatter import without_scatter  # scipy is slow to import, and a list needs none

    read, rows = table.column(name) ** power, np.arange(table.n)
    line = np.polyval(np.polyfit(rows, read, 1), rows)
    readings = 1 + int(np.count_nonzero(np.diff(read)))
    found = without_scatter(read - line, readings)
    return np.asarray(line + found.values), found.error * float(np.sqrt(np.mean(found.values**2)))
