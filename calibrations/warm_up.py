"""The exponential approach to a steady state after power-on: what the effects of warming up share."""

from __future__ import annotations

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

PARTS = (0.05, 0.2, 0.6)  # of the record's length: time constants to begin with
TIME_CONSTANT = Parameter(
    "time_constant", "s", typical=600.0, per_axis=False, starts=(600.0,), low=1e-3, doc="of the exponential"
)


def begin_s(table: Table) -> float:
    """When the record begins, in s: the amplitude is that of this moment."""
    return float(np.min(table.time_s))


def time_constants_s(table: Table) -> Array:
    """(starts, axes) time constants to begin a fit with, in s."""
    return np.outer(PARTS, np.full(len(table.axes), np.ptp(table.time_s)))


def left(table: Table, p: Values) -> Array:
    """(n,) the share of the approach that is still to come."""
    share: Array = np.exp(-(table.time_s - p["begin_s"]) / p["time_constant"])
    return share
