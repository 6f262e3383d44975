"""Several tables of one sensor as one: earlier and later measurements are analysed together."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from calibrations.errors import DataError
from calibrations.table import Array, Constant, Table

ZERO_WHERE_MISSING = ("mount_deg", "flip", "direction")  # no column: the sensor was never turned over
MEASURED = "noise_inflation_"  # constants that each table measured for itself


def join_tables(tables: Sequence[Table]) -> Table:
    """One table with the rows of all, in the order given, and the columns that all have.

    Time is continuous: a table whose clock restarted begins at the end of the table before it. Constants are those
    on which all agree; the measured noise is the mean of theirs. Raises DataError for different kinds or axes.
    """
    first = tables[0]
    if len(tables) == 1:
        return first
    for further in tables[1:]:
        if (further.kind, further.axes, further.unit) != (first.kind, first.axes, first.unit):
            raise DataError(
                f"{further.source}: is a table of {further.kind} along {', '.join(further.axes)}, {first.source} one "
                f"of {first.kind} along {', '.join(first.axes)}; only tables of the same kind and axes can be "
                "analysed together"
            )
    columns = {name: np.concatenate([t.optional(name, 0.0) for t in tables]) for name in _common(tables)}
    if "t_s" in columns:
        columns["t_s"] = np.concatenate(_times(tables))
    labels = {
        name: tuple(text for t in tables for text in t.labels[name])
        for name in first.labels
        if all(name in t.labels for t in tables)
    }
    return Table.from_columns(first.kind, columns, _constants(tables), " + ".join(t.source for t in tables), labels)


def has_clock_restart(tables: Sequence[Table]) -> bool:
    """Whether a table begins before the one before it ended."""
    spans = [(float(t.time_s.min()), float(t.time_s.max())) for t in tables if "t_s" in t]
    return any(later[0] <= earlier[1] for earlier, later in pairwise(spans))


def _common(tables: Sequence[Table]) -> list[str]:
    names = dict.fromkeys(name for t in tables for name in t.columns)
    return [name for name in names if all(name in t or name in ZERO_WHERE_MISSING for t in tables)]


def _times(tables: Sequence[Table]) -> list[Array]:
    """The times of each table, s; the first pose of a later one follows the last at the usual distance."""
    times = [tables[0].time_s]
    for table in tables[1:]:
        t, end = table.time_s, float(times[-1].max())
        usual = float(np.median(np.diff(np.sort(t)))) if table.n > 1 else 1.0
        times.append(t if t.min() > end else t - t.min() + end + usual)
    return times


def _constants(tables: Sequence[Table]) -> dict[str, Constant]:
    constants: dict[str, Constant] = {}
    for name, value in tables[0].constants.items():
        values = [t.constants.get(name) for t in tables]
        if name.startswith(MEASURED) and None not in values:
            constants[name] = float(np.mean([t.number(name, 1.0) for t in tables]))
        elif all(constant == value for constant in values):
            constants[name] = value
    return constants
