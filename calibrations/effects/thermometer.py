"""The temperature of the sensor from that of the thermometer, which follows it late or early."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from calibrations.table import Array, Table

RATE = "temperature_rate_c_s"  # input of a product: how fast its thermometer's reading changes, C/s
SMOOTHED_ROWS, FEWEST_SMOOTHED = 11, 5  # of a thermometer, whose noise would hide its lag


def sensor_temperature_c(table: Table, lead_s: float) -> Array:
    """The temperature that the thermometer shows `lead_s` later, deg C, shape (n,).

    As logged where that is 0. A single row has no later reading: there the column `temperature_rate_c_s` tells it,
    and without this column it is as logged.
    """
    if lead_s and table.n > 1:
        return leading_temperature(table, lead_s)
    if lead_s and RATE in table:
        return table.column("temperature_c") + lead_s * table.column(RATE)
    return table.column("temperature_c")


def temperature_rate_c_s(table: Table) -> Array:
    """How fast the thermometer's reading changes, C/s, shape (n,): as logged, else from the reading; rows in order."""
    if RATE in table:
        return table.column(RATE)
    return np.asarray(np.gradient(leading_temperature(table, 0.0), table.time_s))


@lru_cache(maxsize=64)
def leading_temperature(table: Table, lead_s: float) -> Array:
    """The same without the noise of the thermometer: a local line over some rows; as logged where no time changes."""
    shown = table.column("temperature_c")
    if "t_s" not in table or not np.ptp(table.time_s) > 0:
        return shown
    return np.interp(table.time_s + lead_s, table.time_s, _smooth(shown, min(SMOOTHED_ROWS, 2 * (table.n // 4) + 1)))


def _smooth(x: Array, width: int) -> Array:
    """A straight line fitted to `width` rows about each row, an odd number; at the ends to the first and the last."""
    if width < FEWEST_SMOOTHED:
        return x
    half, rows = width // 2, np.arange(width)
    first, last = np.polyfit(rows, x[:width], 1), np.polyfit(rows, x[-width:], 1)
    inside = np.convolve(x, np.full(width, 1 / width), "valid")
    return np.concatenate([np.polyval(first, rows[:half]), inside, np.polyval(last, rows[half + 1 :])])
