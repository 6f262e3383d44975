"""Logged columns as a sensor feels them: without the scatter of their readings, and ahead of or behind a thermometer.

Heat flows in proportion to a difference of temperature, so that sensor and thermometer follow one another as a
first-order lag: the faster one is T + tau dT/dt of the slower one.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from calibrations.geometry.smooth import smooth_columns
from calibrations.table import Array, Table

RATE = "temperature_rate_c_s"  # input of a product: how fast its thermometer's reading changes, C/s
UNKNOWN_LEVEL = 0.5  # error of a level over its rms: with more it follows the scatter, which may resemble anything
EVIDENT = 10.0  # gain of -2 log likelihood by which outputs follow a level, and not its readings


def level(table: Table, name: str, power: int = 1) -> Array:
    """A column to a power of 1 or 2 without the scatter of its readings, shape (n,), rows in order of time.

    As logged where no time changes, as in a single row: the scatter is known from the neighbours.
    """
    if not has_times(table):
        return table.column(name) if power == 1 else table.column(name) ** power
    return _without_scatter(table, name, power)[0]


def reading_error(table: Table, name: str, power: int = 1, lead_s: float = 0.0) -> float:
    """Rms error of that level and of `lead_s` times its rate over its rms, as the scatter of the readings leaves it."""
    values, error, change = _without_scatter(table, name, power)
    row_s = float(np.ptp(table.time_s)) / max(table.n - 1, 1) or np.inf
    return float(np.hypot(error, lead_s * change / row_s)) / (float(np.std(values)) or 1.0)


def level_is_known(table: Table, name: str, power: int = 1) -> bool:
    """Whether the readings show a level beneath their scatter, and not scatter alone."""
    return has_times(table) and reading_error(table, name, power) < UNKNOWN_LEVEL


def has_times(table: Table) -> bool:
    """Whether the rows have a time that changes."""
    return table.n > 1 and "t_s" in table and bool(np.ptp(table.time_s) > 0)


LEVEL_DOC = "follows the readings without their scatter (1: yes, 0: no)"  # what `follows_level` says


def follows_level(table: Table, names: Sequence[str], power: int = 1, scales: bool = False) -> float:
    """1.0 where the outputs of poses follow the level of a column, one or one an axis, more closely than its readings.

    Else 0.0. Smooth functions of the direction of gravity are fitted too, because other effects may follow them.
    `scales`: the column changes the sensitivity, and the outputs follow it in proportion to themselves.
    """
    if table.kind != "poses" or any(name not in table or not level_is_known(table, name, power) for name in names):
        return 0.0
    smooth = np.column_stack([np.ones(table.n), smooth_columns(table)])

    def left(columns: Sequence[Array]) -> float:
        total = 0.0
        for k, output in enumerate(table.outputs.T):
            column = columns[k % len(columns)]
            factor = output - output.mean() if scales else 1.0
            X = np.column_stack([smooth, (column - column.mean()) * factor])
            X /= np.maximum(np.linalg.norm(X, axis=0), np.finfo(float).tiny)
            total += float(np.sum((output - X @ np.linalg.lstsq(X, output, rcond=1e-9)[0]) ** 2))
        return total

    readings = [table.column(name) ** power for name in names]
    levels = [level(table, name, power) for name in names]
    return float(table.n * np.log(left(readings) / left(levels)) > EVIDENT)


@lru_cache(maxsize=32)
def _without_scatter(table: Table, name: str, power: int) -> tuple[Array, float, float]:
    """Level, its rms error and that of its change from row to row, in the column's unit to the power.

    A standard deviation scatters in proportion to itself, so that its logarithm is smoothed.
    """
    readings = table.column(name)
    if name in table.std_names and np.all(readings > 0):
        exponent, error, change = _smooth(power * np.log(readings))
        values = np.exp(exponent)
        size = float(np.sqrt(np.mean(values**2)))
        return values, error * size, change * size
    return _smooth(readings**power)


def _smooth(logged: Array) -> tuple[Array, float, float]:
    """The level of readings (n,), its rms error and that of its change from row to row.

    The straight line is taken off first: the cosine transform continues a record as its mirror image, and the line
    would have a corner there.
    """
    from calibrations.estimators.scatter import without_scatter  # scipy is slow to import, and a list needs none

    rows = np.arange(len(logged))
    line = np.polyval(np.polyfit(rows, logged, 1), rows)
    readings = 1 + int(np.count_nonzero(np.diff(logged)))
    smooth = without_scatter(logged - line, readings)
    values = line + smooth.values
    of_line = float(np.std(logged - values)) / np.sqrt(len(logged))  # rms: scatter alone has a slope as well
    return np.asarray(values), float(np.hypot(smooth.error, of_line)), smooth.change_error


def sensor_temperature_c(table: Table, lead_s: float, of_level: bool = False) -> Array:
    """The temperature of the sensor, which the thermometer follows with a time constant of `lead_s`, deg C, shape (n,).

    A negative one is that of the sensor, which follows the thermometer. As logged where it is 0, or its level if
    `of_level`. A single row has no neighbours: there the column `temperature_rate_c_s` tells the rate, and
    without this column it is as logged.
    """
    if (lead_s or of_level) and table.n > 1:
        return leading_temperature(table, lead_s)
    if lead_s and RATE in table:
        return table.column("temperature_c") + lead_s * table.column(RATE)
    return table.column("temperature_c")


def temperature_rate_c_s(table: Table) -> Array:
    """Rate of change of the thermometer's reading, C/s, shape (n,): as logged, else from the reading; rows in order."""
    if RATE in table:
        return table.column(RATE)
    return _rate(leading_temperature(table, 0.0), table.time_s)


@lru_cache(maxsize=64)
def leading_temperature(table: Table, lead_s: float) -> Array:
    """`sensor_temperature_c` from readings without their scatter; the logged temperature if no time changes."""
    logged = table.column("temperature_c")
    if not has_times(table):
        return logged
    temperature, t = level(table, "temperature_c"), table.time_s
    return temperature + lead_s * _rate(temperature, t) if lead_s >= 0 else _lag(temperature, t, -lead_s)


def _rate(x: Array, t: Array) -> Array:
    """dx/dt, (n,), by the mean of the rows that have one time; 0 where all have."""
    times, row = np.unique(t, return_inverse=True)
    if len(times) < 2:
        return np.zeros_like(x)
    mean = np.bincount(row, x) / np.bincount(row)
    return np.asarray(np.gradient(mean, times)[row])


def _lag(x: Array, t: Array, time_constant_s: float) -> Array:
    """x behind a first-order lag, (n,), settled at the first row; straight between the rows."""
    step = np.diff(t)
    memory = np.exp(-step / time_constant_s)
    ramps = time_constant_s * np.diff(x) / np.where(step > 0, step, np.inf)
    lagged = np.empty_like(x)
    lagged[0] = x[0]
    for i, (share, ramp) in enumerate(zip(memory, ramps, strict=True)):
        lagged[i + 1] = x[i + 1] - ramp + share * (lagged[i] - x[i] + ramp)
    return lagged
