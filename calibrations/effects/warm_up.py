"""The exponential approach to a steady state after power-on: shared by the warm-up effects."""

from __future__ import annotations

import numpy as np

from calibrations.effects import Parameter, Values
from calibrations.table import Array, Table

SHORTEST_S = 1e-3  # a time constant
PARTS = (0.05, 0.2, 0.6)  # of the record's length: time constants from which a fit starts


def begin_s(table: Table) -> float:
    """Time at which the record begins, s: the amplitude refers to it."""
    return float(np.min(table.time_s))


def time_constants_s(table: Table) -> Array:
    """(starts, axes) time constants from which a fit starts, s; SHORTEST_S for a record at one time."""
    starts = np.outer(PARTS, np.full(len(table.axes), np.ptp(table.time_s)))
    return np.asarray(np.maximum(starts, SHORTEST_S))


def remaining_share(table: Table, p: Values) -> Array:
    """Share of the approach that is still to come, shape (n,)."""
    share: Array = np.exp(-(table.time_s - p.begin_s) / p.time_constant)
    return share


TIME_CONSTANT = Parameter(
    "s",
    typical=600.0,
    per_axis=False,
    starts=(600.0,),
    low=SHORTEST_S,
    guess=time_constants_s,
    doc="of the exponential",
)
