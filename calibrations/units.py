"""What a fit is told in: the unit of its errors, in thousandths of what is sensed, and the name of its rows.

Apart from the pictures, so that text needs no drawing library.
"""

from __future__ import annotations

import numpy as np

from calibrations.compare import scales
from calibrations.fit import Fit
from calibrations.table import MILLI, Array, Table

ROWS = {"motion": "stretches"}  # what the rows of a kind of table are called, where not as the kind


def rows_of(table: Table) -> str:
    """What its rows are called."""
    return ROWS.get(table.kind, table.kind)


def milli(fit: Fit) -> str:
    """The unit of `mg`: of what the sensor senses."""
    return MILLI[fit.table.input_unit]


def mg(values: Array, fit: Fit) -> Array:
    """Values per channel, in the residual's unit, as mg; as thousandths of the field, or mdeg/s, of other sensors."""
    return np.asarray(1e3 * values / scales(fit))


def pooled_mg(fit: Fit) -> tuple[float, float]:
    """Rms of the residual over all channels, and the noise floor, both in mg."""
    error, floor = mg(fit.rmse, fit), mg(fit.noise.floor, fit)
    return float(np.sqrt(np.mean(error**2))), float(np.sqrt(np.mean(floor**2)))
