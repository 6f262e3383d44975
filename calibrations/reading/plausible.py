"""Whether numbers can be in the unit that a file is taken to have them in.

A wrong unit fits nothing, and nothing says why: so it is refused with the unit that would fit. Bounds are judgements;
whoever states the unit of a column, in the header or as NAME=THEIRS:UNIT, is believed, but for what no rig can do.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

import numpy as np

from calibrations.errors import DataError
from calibrations.reading.stills import sphere_centre
from calibrations.reading.units import own_unit
from calibrations.table import NUMBERS, Array, Table

HIGHEST_V = 50.0  # analog outputs of sensors end at their supply, 36 V at the most
HOTTEST_C, COLDEST_C = 200.0, -100.0  # parts are specified from -55 to 125 degC, some to 175
LONGEST_M = 0.5  # a piezo stage travels 0.1 mm, a shaker some centimetres
LARGEST_ALPHA_DEG = 360.0  # an inclination is known within a turn
LARGEST_BETA_DEG = 3600.0  # ten turns: cables allow less
ARC_MINUTE_DEG = 1 / 60
ROUNDING_DEG = 1e-3
MANY = 6  # values: that they all lie on whole arc minutes by chance has odds of one in millions
STILL_G = (0.3, 3.0)  # a sensor at rest shows 1 g, its bias and scale factor within reason
EARTH_UT = (20.0, 70.0)  # on the ground 22 to 67 uT (World Magnetic Model)
UNLIKE = 0.3  # interquartile range of a magnitude over its median: scale factors of cheap sensors differ by tenths
FLAT = 0.01  # mean square of directions along the axis that they have least of, 1/3 over the whole sphere
Doubt = tuple[str, str]  # what speaks against the unit, and the unit that would fit, "" where none does


def doubts(table: Table, stated: Collection[str]) -> dict[str, Doubt]:
    """The columns that can hardly be in their unit. `stated`: those whose unit the file or a person gives."""
    asked = {name: _doubt(name, values, name in stated) for name, values in table.columns.items()}
    return {name: doubt for name, doubt in asked.items() if doubt is not None}


def looks_like_radians(values: Array) -> bool:
    """Whether angles lie within a turn in rad, off the grid of whole arc minutes that degrees are set on."""
    some: Array = np.unique(np.round(np.abs(values), 6))
    some = some[some > ROUNDING_DEG]
    if not len(some) or some[-1] > 2 * np.pi * 1.001 or _on_grid(some, ARC_MINUTE_DEG, ROUNDING_DEG):
        return False
    return len(some) >= MANY or _on_grid(some, np.pi / 36, ROUNDING_DEG)


def _on_grid(values: Array, step: float, rounding: float) -> bool:
    return bool(np.all(np.abs(values - step * np.round(values / step)) < rounding))


def fitting_unit(name: str, values: Array) -> str:
    """The unit that makes sense of numbers that are no V, deg, degC or m; "" where they may be that."""
    doubt = _unlikely(name, values)
    return doubt[1] if doubt else ""


def gravity_unit(outputs: Array) -> str:
    """The unit in which still outputs, shape (n, 3), have the magnitude of gravity: g, mg or m/s2; else "counts"."""
    size = float(np.median(np.linalg.norm(outputs, axis=1)))
    near = {"g": 1.0, "m/s2": 9.81, "mg": 1000.0}
    return next((unit for unit, one_g in near.items() if 0.8 < size / one_g < 1.25), "counts")


def field_unit(outputs: Array) -> str:
    """ "uT" where outputs, shape (n, 3), have the magnitude of the earth's field, whatever the hard iron; else ""."""
    size = float(np.median(np.linalg.norm(outputs - sphere_centre(outputs), axis=1)))
    return "uT" if EARTH_UT[0] < size < EARTH_UT[1] else ""


def seen_from_all_sides(outputs: Array) -> bool:
    """Whether outputs, shape (n, 3), may be of a sensor that is turned in one field: distances from the centre of a
    sphere nearly the same, and directions from it that are spread over it."""
    away = outputs - sphere_centre(outputs)
    size = np.linalg.norm(away, axis=1)
    low, middle, high = np.quantile(size, [0.25, 0.5, 0.75])
    if not middle > 0 or (high - low) / middle > UNLIKE:
        return False
    directions = away / np.maximum(size, np.finfo(float).tiny)[:, None]
    return bool(np.linalg.eigvalsh(directions.T @ directions / len(outputs))[0] > FLAT)


def _doubt(name: str, values: Array, stated: bool) -> Doubt | None:
    return _impossible(name, values) or (None if stated else _unlikely(name, values))


def _impossible(name: str, values: Array) -> Doubt | None:
    limit = {"alpha_deg": LARGEST_ALPHA_DEG, "beta_deg": LARGEST_BETA_DEG}.get(name)
    largest = float(np.max(np.abs(values)))
    if limit is not None and largest > limit:
        return f"reaches {largest:.6g} deg, and no stage turns beyond {limit:g}", ""
    return None


def _unlikely(name: str, values: Array) -> Doubt | None:
    ask = DOUBTS.get(own_unit(name)) if name in NUMBERS else None
    return ask(values) if ask else None


def _angle(values: Array) -> Doubt | None:
    if not looks_like_radians(values):
        return None
    return f"runs from {values.min():.4g} to {values.max():.4g}, on no grid of degrees: these look like radians", "rad"


def _voltage(values: Array) -> Doubt | None:
    largest = float(np.max(np.abs(values)))
    if largest <= HIGHEST_V:
        return None
    unit = "mV" if largest <= 1e3 * HIGHEST_V else "uV" if largest <= 1e6 * HIGHEST_V else ""
    return f"reaches {largest:.6g} V, and no sensor puts out more than {HIGHEST_V:g} V", unit


def _length(values: Array) -> Doubt | None:
    longest = float(np.max(np.abs(values)))
    return (f"reaches {longest:.6g} m, and no stage travels so far", "um") if longest > LONGEST_M else None


def _temperature(values: Array) -> Doubt | None:
    low, high = float(values.min()), float(values.max())
    if low >= COLDEST_C and high <= HOTTEST_C:
        return None
    unit = "K" if low - 273.15 >= COLDEST_C and high - 273.15 <= HOTTEST_C else ""
    return f"runs from {low:.6g} to {high:.6g} degC, and no sensor lives there", unit


DOUBTS: Mapping[str, Callable[[Array], Doubt | None]] = {
    "deg": _angle,
    "V": _voltage,
    "degC": _temperature,
    "m": _length,
}


def check_at_rest(table: Table) -> None:
    """An accelerometer at rest shows the magnitude of gravity. Raises DataError; a table in counts is not asked, nor
    one of a magnetometer, whose unit is that of the field."""
    one_g = {"g": 1.0, "m/s2": table.gravity_m_s2}.get(table.unit)
    if one_g is None or table.content != "positions":
        return
    size = float(np.median(np.linalg.norm(table.outputs, axis=1)))
    if STILL_G[0] <= size / one_g <= STILL_G[1]:
        return
    unit = gravity_unit(table.outputs)
    fits = f"they look like {unit}: --column ax=...:{unit}, and so for ay and az" if unit != "counts" else ""
    whatever = "outputs of a scale of their own are imported as counts: --column ax=...:counts, and so for ay and az"
    raise DataError(
        f"{table.source}: ax, ay, az have the magnitude {size:.4g} {table.unit}, where a sensor at rest shows "
        f"{one_g:.4g}; {fits or whatever}"
    )
