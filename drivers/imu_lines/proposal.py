"""Proposed settings of a digital sensor at rest, from its first lines.

The format follows from the shape of the lines. Named columns tell what they are. Of numbered columns, the time grows
evenly; the accelerometer is the three neighbours whose norm at rest is 1 g, in g, m/s^2 or a power of two in counts;
after it, by custom, come a gyroscope and a magnetometer.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.digital.settings import TEMPERATURE
from drivers.imu_lines.lines import TIME, Column, fields

FEWEST = 5  # samples
NEAR = 0.1  # of 1 g, for the norm at rest
ONE_G = {"g": (1.0,), "m/s^2": (9.80665,), "count": tuple(float(1 << k) for k in range(7, 16))}
STEP_TOLERANCE = 0.5  # of the median step of the time, by which a step may differ
ORDER = (TIME, *(f"{sensor}{axis}" for sensor in "agm" for axis in "xyz"), TEMPERATURE)
NAMES = (  # of a column, in small letters; the first match
    (r"^(t|ts|time|ms|us|micros|millis|timestamp)(_?[mu]?s)?$", TIME),
    (r"^(temp|temperature)(_?(deg)?c)?$", TEMPERATURE),
    (r"^(a|acc|accel|acceleration)_?([xyz])$", "a"),
    (r"^(g|w|gyr|gyro|omega)_?([xyz])$", "g"),
    (r"^(m|mag|b|field)_?([xyz])$", "m"),
)


def propose_settings(lines: Sequence[str], length_s: float) -> dict[str, Any] | None:
    """The settings of a bench file for these whole lines, which came in `length_s`; None where they show none."""
    style = _style(lines)
    values = _columns(lines, style)
    if not values:
        return None
    rate_hz = _round(max(len(column) for column in values.values()) / length_s)
    names = _columns_by_name(values) if style in ("named", "teleplot") else _columns_by_value(values)
    names = {name: names[name] for name in ORDER if name in names}
    force = [values[names[name]] for name in ("ax", "ay", "az") if name in names]
    if len(force) < 3:
        return None
    settings: dict[str, Any] = {"format": style, "columns": names, "unit": _fit(force)[1], "rate_hz": rate_hz}
    if TIME in names:
        step = float(np.median(np.diff(values[names[TIME]])))
        settings["time_unit_s"] = min((1.0, 1e-3, 1e-6, 1e-9), key=lambda size: abs(np.log(step * size * rate_hz)))
    return settings


def _style(lines: Sequence[str]) -> str:
    """The format in which most lines can be read, the most particular first."""
    shapes = {"teleplot": r">\w+:", "nmea": r"\$\w+,.*\*[0-9A-Fa-f]{2}$", "named": r".*[A-Za-z_]\w*\s*[:=]\s*[-+.\d]"}
    counts = {style: sum(bool(re.match(shape, line)) for line in lines) for style, shape in shapes.items()}
    return next((style for style, count in counts.items() if 2 * count > len(lines)), "csv")


def _columns(lines: Sequence[str], style: str) -> Mapping[Column, NDArray[np.float64]]:
    """The values of each column that is in most samples; none for too few samples."""
    values_by_column: dict[Column, list[float]] = {}
    for line in lines:
        with suppress(ValueError):
            for column, value in fields(line, style).items():
                values_by_column.setdefault(column, []).append(value)
    most = max(map(len, values_by_column.values()), default=0)
    common = {
        column: np.array(values) for column, values in values_by_column.items() if 2 * len(values) > most >= FEWEST
    }
    shortest = min(map(len, common.values()), default=0)  # the last sample may lack columns
    return {column: values[:shortest] for column, values in common.items() if np.isfinite(values).all()}


def _columns_by_name(values: Mapping[Column, NDArray[np.float64]]) -> dict[str, Column]:
    """Our name for each known column."""
    columns: dict[str, Column] = {}
    for column in values:
        matches = ((re.match(pattern, str(column).lower()), name) for pattern, name in NAMES)
        match, name = next(((match, name) for match, name in matches if match), (None, ""))
        if match is not None:
            columns.setdefault(name if name in (TIME, TEMPERATURE) else f"{name}{match[2]}", column)
    return columns


def _columns_by_value(values: Mapping[Column, NDArray[np.float64]]) -> dict[str, Column]:
    """Time and accelerometer by their values, then the triads behind it by custom."""
    clock = next((column for column, series in values.items() if _grows_evenly(series)), None)
    other_columns = [column for column in values if column != clock]
    fits = [
        (_fit([values[column] for column in other_columns[k : k + 3]])[0], k) for k in range(len(other_columns) - 2)
    ]
    misfit, start = min(fits, default=(1.0, 0))
    if misfit > NEAR:
        return {}
    names = {} if clock is None else {TIME: clock}
    for sensor, first in zip("agm", range(start, len(other_columns) - 2, 3), strict=False):
        names |= {f"{sensor}{axis}": other_columns[first + k] for k, axis in enumerate("xyz")}
    return names


def _grows_evenly(values: NDArray[np.float64]) -> bool:
    steps = np.diff(values)
    typical = float(np.median(steps))
    return typical > 0 and float(np.mean(np.abs(steps - typical) <= STEP_TOLERANCE * typical)) > 1 - NEAR


def _fit(force: Sequence[NDArray[np.float64]]) -> tuple[float, str]:
    """The deviation of the norm at rest from 1 g, as a share of 1 g, and the unit. Only counts are whole numbers."""
    norm = float(np.median(np.linalg.norm(np.stack(force), axis=0)))
    is_integer = all(np.array_equal(axis, np.rint(axis)) for axis in force)
    sizes = ((size, unit) for unit, sizes in ONE_G.items() for size in sizes if is_integer == (unit == "count"))
    return min((abs(norm / size - 1), unit) for size, unit in sizes)


def _round(rate_hz: float) -> float:
    """The rate rounded to a usual one: 99.3 becomes 100, or else two digits."""
    usual = min((10.0, 20.0, 25.0, 50.0, 100.0, 200.0, 250.0, 400.0, 500.0, 1000.0), key=lambda u: abs(rate_hz / u - 1))
    return usual if abs(rate_hz / usual - 1) < NEAR / 2 else float(f"{rate_hz:.2g}")
