"""The temperature of the sensor from that of the thermometer: one of the two follows the other.

Heat flows in proportion to a difference of temperature, so that each follows as a first-order lag: the faster one is
T + tau dT/dt of the slower one.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from calibrations.effects.logged import level
from calibrations.table import Array, Table

RATE = "temperature_rate_c_s"  # input of a product: how fast its thermometer's reading changes, C/s


def sensor_temperature_c(table: Table, lead_s: float) -> Array:
    """The temperature of the sensor, which the thermometer follows with a time constant of `lead_s`, deg C, shape (n,).

    A negative one is that of the sensor, which follows the thermometer. As logged where it is 0. A single row has no
    neighbours: there the column `temperature_rate_c_s` tells the rate, and without this column it is as logged.
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
    return _rate(leading_temperature(table, 0.0), table.time_s)


@lru_cache(maxsize=64)
def leading_temperature(table: Table, lead_s: float) -> Array:
    """The same from the readings without their scatter; as logged where no time changes."""
    shown = table.column("temperature_c")
    if "t_s" not in table or not np.ptp(table.time_s) > 0:
        return shown
    temperature, t = level(table, "temperature_c"), table.time_s
    return temperature + lead_s * _rate(temperature, t) if lead_s >= 0 else _lagging(temperature, t, -lead_s)


def _rate(x: Array, t: Array) -> Array:
    """dx/dt, (n,), by the mean of the rows that have one time; 0 where all have."""
    times, row = np.unique(t, return_inverse=True)
    if len(times) < 2:
        return np.zeros_like(x)
    mean = np.bincount(row, x) / np.bincount(row)
    return np.asarray(np.gradient(mean, times)[row])


def _lagging(x: Array, t: Array, time_constant_s: float) -> Array:
    """x behind a first-order lag, (n,), settled at the first row; straight between the rows."""
    step = np.diff(t)
    kept = np.exp(-step / time_constant_s)
    behind = time_constant_s * np.diff(x) / np.where(step > 0, step, np.inf)
    out = np.empty_like(x)
    out[0] = x[0]
    for i, (share, ramp) in enumerate(zip(kept, behind, strict=True)):
        out[i + 1] = x[i + 1] - ramp + share * (out[i] - x[i] + ramp)
    return out
