"""Checks whether numbers are possible in the unit that a file gives them.

A wrong unit fits no model and gives no hint, so it is refused with the unit that would fit. The limits are judgements.
A unit that a person states, in the header or as NAME=THEIRS:UNIT, is accepted unless no rig can reach the value.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

import numpy as np

from calibrations.criteria import (
    COLDEST_C,
    EARTH_UT,
    FEWEST_ANGLES,
    HIGHEST_V,
    HOTTEST_C,
    LARGEST_ALPHA_DEG,
    LARGEST_BETA_DEG,
    LEAST_DIRECTION_SHARE,
    LONGEST_M,
    MOST_MAGNITUDE_SPREAD,
    RATE_AGREES,
    SHOWN_OF_RATE,
    STILL_G,
)
from calibrations.errors import DataError, MissingConstant
from calibrations.geometry.rate_table import turn_axes
from calibrations.geometry.sphere import sphere_centre
from calibrations.importing.units import UNITS, ColumnMapping, column_unit
from calibrations.table import NUMBERS, Array, Constant, Table

ARC_MINUTE_DEG = 1 / 60
ROUNDING_DEG = 1e-3
FEWEST_RATES = 2  # on one grid by chance, and off the grid of round numbers: one table in a thousand
FASTEST_RAD_S = 60.0
LARGEST = 1e9  # more than any angle or rate
RATE_ROUNDING = 1e-3
ROUND_DEG_S = 0.05
Doubt = tuple[str, str]  # the reason, and the unit that would fit, "" for none


def find_unit_doubts(table: Table, stated_columns: Collection[str]) -> dict[str, Doubt]:
    """The columns with an unlikely unit. `stated_columns`: columns whose unit the file or a person gives."""
    doubts = {name: _doubt(name, values, name in stated_columns) for name, values in table.columns.items()}
    return {name: doubt for name, doubt in doubts.items() if doubt is not None}


def looks_like_radians(values: Array) -> bool:
    """Whether angles lie within one turn in rad and off the grid of whole arc minutes on which degrees are set."""
    distinct = _distinct_magnitudes(values)
    if not len(distinct) or distinct[-1] > 2 * np.pi * 1.001 or _is_on_grid(distinct, ARC_MINUTE_DEG, ROUNDING_DEG):
        return False
    return len(distinct) >= FEWEST_ANGLES or _is_on_grid(distinct, np.pi / 36, ROUNDING_DEG)


def _distinct_magnitudes(values: Array) -> Array:
    """The different magnitudes above 0. Those beyond every unit count as one: 1e308 cannot be rounded."""
    distinct: Array = np.unique(np.round(np.minimum(np.abs(values), LARGEST), 6))
    return distinct[distinct > ROUNDING_DEG]


def _is_on_grid(values: Array, step: float, rounding: float) -> bool:
    return bool(np.all(np.abs(values - step * np.round(values / step)) < rounding))


def likely_unit(name: str, values: Array) -> str:
    """The unit that fits numbers that are unlikely in V, deg, degC or m; "" where they are likely."""
    doubt = _doubt_about(name, values)
    return doubt[1] if doubt else ""


def gravity_unit(outputs: Array) -> str:
    """The unit in which still outputs, shape (n, 3), have the magnitude of gravity: g, mg or m/s2; else "counts"."""
    size = float(np.median(np.linalg.norm(outputs, axis=1)))
    magnitudes = {"g": 1.0, "m/s2": 9.81, "mg": 1000.0}
    return next((unit for unit, one_g in magnitudes.items() if 0.8 < size / one_g < 1.25), "counts")


def unit_at_rest(outputs: Array) -> str:
    """The unit of still outputs, shape (n, 3): that of gravity, V for small numbers with decimals, else "counts"."""
    unit = gravity_unit(outputs)
    is_voltage = np.max(np.abs(outputs)) <= HIGHEST_V and np.any(outputs % 1 != 0)
    return "V" if unit == "counts" and is_voltage else unit


def field_unit(outputs: Array) -> str:
    """uT where outputs, shape (n, 3), have the magnitude of the earth's field, for any hard iron; else ""."""
    size = float(np.median(np.linalg.norm(outputs - sphere_centre(outputs), axis=1)))
    return "uT" if EARTH_UT[0] < size < EARTH_UT[1] else ""


def covers_all_directions(outputs: Array) -> bool:
    """Whether outputs, shape (n, 3), can come from a sensor turned in one field: about constant distance from a
    sphere's
    centre, and directions spread over the sphere.
    """
    centred = outputs - sphere_centre(outputs)
    size = np.linalg.norm(centred, axis=1)
    low, middle, high = np.quantile(size, [0.25, 0.5, 0.75])
    if not middle > 0 or (high - low) / middle > MOST_MAGNITUDE_SPREAD:
        return False
    directions = centred / np.maximum(size, np.finfo(float).tiny)[:, None]
    return bool(np.linalg.eigvalsh(directions.T @ directions / len(outputs))[0] > LEAST_DIRECTION_SHARE)


def _doubt(name: str, values: Array, has_unit: bool) -> Doubt | None:
    return _impossible(name, values) or (None if has_unit else _doubt_about(name, values))


def _impossible(name: str, values: Array) -> Doubt | None:
    limit = {"alpha_deg": LARGEST_ALPHA_DEG, "beta_deg": LARGEST_BETA_DEG}.get(name)
    largest = float(np.max(np.abs(values)))
    if limit is not None and largest > limit:
        return f"reaches {largest:.6g} deg; no stage turns beyond {limit:g} deg", ""
    return None


def _doubt_about(name: str, values: Array) -> Doubt | None:
    check = UNIT_CHECKS.get(column_unit(name)) if name in NUMBERS else None
    return check(values) if check else None


def _angle(values: Array) -> Doubt | None:
    if not looks_like_radians(values):
        return None
    return f"runs from {values.min():.4g} to {values.max():.4g}, not on whole degrees: it looks like radians", "rad"


def _rate(values: Array) -> Doubt | None:
    """Rates that are whole multiples of 5 deg/s if they are in rad/s, and no round numbers as they are."""
    distinct = _distinct_magnitudes(values)
    if (
        len(distinct) < FEWEST_RATES
        or distinct[-1] > FASTEST_RAD_S
        or not _is_on_grid(distinct, np.pi / 36, RATE_ROUNDING)
    ):
        return None
    if _is_on_grid(distinct, ROUND_DEG_S, ROUNDING_DEG / 2):
        return None
    return (
        f"runs from {values.min():.4g} to {values.max():.4g}, in whole multiples of 5 deg/s if it is in rad/s",
        "rad/s",
    )


def _voltage(values: Array) -> Doubt | None:
    largest = float(np.max(np.abs(values)))
    if largest <= HIGHEST_V:
        return None
    unit = "mV" if largest <= 1e3 * HIGHEST_V else "uV" if largest <= 1e6 * HIGHEST_V else ""
    return f"reaches {largest:.6g} V; no sensor output exceeds {HIGHEST_V:g} V", unit


def _length(values: Array) -> Doubt | None:
    longest = float(np.max(np.abs(values)))
    return (f"reaches {longest:.6g} m; this is not plausible for a stage", "um") if longest > LONGEST_M else None


def _temperature(values: Array) -> Doubt | None:
    low, high = float(values.min()), float(values.max())
    if low >= COLDEST_C and high <= HOTTEST_C:
        return None
    unit = "K" if low - 273.15 >= COLDEST_C and high - 273.15 <= HOTTEST_C else ""
    return f"runs from {low:.6g} to {high:.6g} degC; this is not plausible for a sensor", unit


UNIT_CHECKS: Mapping[str, Callable[[Array], Doubt | None]] = {
    "deg": _angle,
    "deg/s": _rate,
    "V": _voltage,
    "degC": _temperature,
    "m": _length,
}


# Times and sample rates.

SHORTEST_POSE_S = 1.0  # to turn to a pose and to measure there
LONGEST_POSE_S = 3600.0
TIME_UNITS = {"ms": 1e-3, "min": 60.0, "h": 3600.0}


def find_time_doubt(time_s: Array, poses: Array) -> Doubt | None:
    """The doubt that a time column is in s: no stage turns from pose to pose so fast, or nobody waits so long.

    `poses`, shape (n, k), are the stage angles. None without a change of pose, and for times that do not increase.
    """
    if len(time_s) < 3 or not np.all(np.diff(time_s) >= 0):
        return None
    turned = np.any(np.diff(poses, axis=0) != 0, axis=1)
    if np.count_nonzero(turned) < len(turned) / 2:  # several rows at a pose: a log
        return None
    step = float(np.median(np.diff(time_s)[turned]))
    if step <= 0 or SHORTEST_POSE_S <= step <= LONGEST_POSE_S:
        return None
    fits = next((u for u, s in TIME_UNITS.items() if SHORTEST_POSE_S <= step * s <= LONGEST_POSE_S), "")
    low, high = float(time_s[0]), float(time_s[-1])
    return f"runs from {low:g} to {high:g}; in s this is {step:.2g} s from one pose to the next", fits


SLOWEST_LOG_HZ = 2.0  # of samples: a hand moves within less than a second
LIKELY_LOG_HZ = (10.0, 20_000.0)


def find_log_time_doubt(time_s: Array, file_column: str = "") -> Doubt | None:
    """The doubt that the time column of a log of samples is in s: no log of a sensor is so slow.

    `file_column`: the file's name of the column. SampleTimeFine of Xsens counts 0.1 ms, or us.
    """
    step = _step_s(time_s)
    if not step or 1 / step >= SLOWEST_LOG_HZ:
        return None
    low, high = LIKELY_LOG_HZ
    units = ("0.1ms", "us") if file_column == "SampleTimeFine" else ("ms", "us", "ns")
    fits = next((unit for unit in units if low <= 1 / (step * UNITS[unit][1]) <= high), "")
    return f"gives {1 / step:.3g} samples a second if it is in s", fits


def log_rate_hz(time_s: Array | None, stated_hz: float, source: str) -> float:
    """The sample rate of a log, Hz: by its times, else as stated; 0 if neither gives it.

    Raises DataError if the two differ.
    """
    step = 0.0 if time_s is None else _step_s(time_s)
    if step and stated_hz > 0 and abs(1 / step / stated_hz - 1) > RATE_AGREES:
        raise DataError(
            f"{source}: t_s gives {1 / step:.4g} samples a second, and the constant sample_rate_hz is {stated_hz:g}; "
            f"correct the unit of t_s (in `rig import`, --column t_s=...:ms), or give --constant "
            f"sample_rate_hz={1 / step:.4g}"
        )
    return 1 / step if step else max(stated_hz, 0.0)


def required_rate_hz(columns: Mapping[str, Array], constants: Mapping[str, Constant], source: str) -> float:
    """The sample rate of a log of turns, Hz. Raises MissingConstant without times and rate, DataError as above."""
    stated_hz = constants.get("sample_rate_hz", 0.0)
    rate_hz = log_rate_hz(columns.get("t_s"), stated_hz if isinstance(stated_hz, float) else 0.0, source)
    if rate_hz <= 0:
        raise MissingConstant(
            f"{source}: a log of turns needs the column t_s, or the constant sample_rate_hz", "sample_rate_hz"
        )
    return rate_hz


def check_stated_rate(table: Table, clock: ColumnMapping) -> None:
    """Check that a log's stated sample rate is that of `clock`, a column that looks like the time and is not used.

    Raises DataError. A column without a unit passes if the rate fits in any unit, or cannot be one in s.
    """
    step, stated_hz = _step_s(table.column(clock.file_column)), table.number("sample_rate_hz", 0.0)
    if not step or stated_hz <= 0:
        return
    units = [clock.unit] if clock.unit else ["s", *TIME_UNITS, "us", "ns"]
    rates_hz = [1 / (step * UNITS[unit][1]) for unit in units]
    fits = any(abs(rate_hz / stated_hz - 1) <= RATE_AGREES for rate_hz in rates_hz)
    if fits or rates_hz[0] < SLOWEST_LOG_HZ:
        return
    raise DataError(
        f'{table.source}: the column "{clock.file_column}" looks like the time and gives {rates_hz[0]:.4g} samples a '
        f"second, and the constant sample_rate_hz is {stated_hz:g}; use the column (in `rig import`, --column "
        f"{clock.text}), or give --constant sample_rate_hz={rates_hz[0]:.4g}"
    )


def _step_s(time_s: Array) -> float:
    """The time between samples, also of a clock that restarted; 0 for times that do not increase."""
    return max(float(np.median(np.diff(time_s))), 0.0) if len(time_s) > 1 else 0.0


# Outputs in a stated unit, against the sensed quantity.


def check_turning(table: Table) -> None:
    """Check that outputs in deg/s and rates are not one in deg/s, one in rad/s. Raises DataError. Counts pass."""
    if table.content != "rates" or table.unit != "deg/s":
        return
    try:
        axis_rates = table.column("rate_deg_s")[:, None] * turn_axes(table)
    except DataError:  # the axes are not known
        return
    slopes, *_ = np.linalg.lstsq(np.column_stack([np.ones(table.n), axis_rates]), table.outputs, rcond=None)
    per_rate = float(np.linalg.norm(slopes[1:], axis=0).max())
    degrees = UNITS["rad/s"][1]
    hints = {
        degrees: "rate_deg_s looks like rad/s: give --column rate_deg_s=...:rad/s",
        1 / degrees: "gx, gy, gz look like rad/s: give --column gx=...:rad/s, likewise gy and gz",
    }
    for size, hint in hints.items():
        if SHOWN_OF_RATE[0] <= per_rate / size <= SHOWN_OF_RATE[1]:
            raise DataError(
                f"{table.source}: gx, gy, gz show {per_rate:.3g} deg/s for each deg/s of rate_deg_s; {hint}; "
                "if the units are right, import the outputs as counts: --column gx=...:counts"
            )


def check_at_rest(table: Table) -> None:
    """Check that an accelerometer at rest shows gravity. Raises DataError. Counts and magnetometers pass."""
    one_g = {"g": 1.0, "m/s2": table.gravity_m_s2}.get(table.unit)
    if one_g is None or table.content != "positions":
        return
    size = float(np.median(np.linalg.norm(table.outputs, axis=1)))
    if STILL_G[0] <= size / one_g <= STILL_G[1]:
        return
    unit = gravity_unit(table.outputs)
    fits = f"they look like {unit}: give --column ax=...:{unit}, likewise ay and az" if unit != "counts" else ""
    as_counts = "import outputs of an unknown scale as counts: --column ax=...:counts, likewise ay and az"
    raise DataError(
        f"{table.source}: ax, ay, az have the magnitude {size:.4g} {table.unit}; a sensor at rest shows "
        f"{one_g:.4g}; {fits or as_counts}"
    )
