"""What stands between the transducer and a sample: the output filter at its nominal corner, and the sampling's skew.

The converter takes the channels of one scan in turn: the sensor's axes `skew_x_s`, `skew_y_s`, `skew_z_s` after the
displacement (constants of the table, 0 where not given).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from calibrations.motion.records import records
from calibrations.motion.spectrum import Response, delayed, first_order, through
from calibrations.table import AXES, Array, Table

NOMINAL_CORNER_HZ = 15.07  # 32 kOhm and 0.33 uF, Ang V, where the table does not say


def corner_hz(table: Table) -> float:
    """The output filter's nominal corner."""
    return table.number("filter_corner_hz", NOMINAL_CORNER_HZ)


def skew_s(table: Table, axis: int) -> float:
    """By how much this axis is sampled later than the displacement."""
    return table.number(f"skew_{AXES[axis]}_s", 0.0)


def nominal(table: Table, axis: int) -> Response:
    """From the transducer's output to the samples of one axis. A sample taken later shows what is later: an advance."""
    low_pass, advance = first_order(corner_hz(table)), delayed(-skew_s(table, axis))
    return lambda f: np.asarray(low_pass(f) * advance(f))


def filtered(v: Array, table: Table, response: Callable[[int], Response]) -> Array:
    """Each column of `v`, shape (n, axes), through its own filter, record by record; other rows as they are.

    Axes that were not measured are left as they are: nothing reads them.
    """
    out = np.array(v)
    for record in records(table):
        for k in range(min(v.shape[1], len(table.axes))):
            out[record.rows, k] = through(v[record.rows, k], record.rate_hz, response(k))
    return out


def sampled(v: Array, table: Table) -> Array:
    """The transducer's output, shape (n, axes), as it is sampled behind the nominal output filter."""
    return filtered(v, table, lambda k: nominal(table, k))
