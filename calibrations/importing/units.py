"""Units of foreign columns and their conversion to V, deg, degC and s; outputs of positions keep their unit.

And the unit of a sensor, which its three axes share.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calibrations.errors import DataError
from calibrations.table import NUMBERS, Constant

# unit -> (unit of the target column, factor, offset)
UNITS: Mapping[str, tuple[str, float, float]] = {
    "V": ("V", 1.0, 0.0), "mV": ("V", 1e-3, 0.0), "uV": ("V", 1e-6, 0.0),
    "deg": ("deg", 1.0, 0.0), "rad": ("deg", 180 / np.pi, 0.0), "mrad": ("deg", 0.18 / np.pi, 0.0),
    "degC": ("degC", 1.0, 0.0), "K": ("degC", 1.0, -273.15), "degF": ("degC", 5 / 9, -160 / 9),
    "s": ("s", 1.0, 0.0), "ms": ("s", 1e-3, 0.0), "us": ("s", 1e-6, 0.0),
    "ns": ("s", 1e-9, 0.0), "0.1ms": ("s", 1e-4, 0.0),
    "min": ("s", 60.0, 0.0), "h": ("s", 3600.0, 0.0),
    "m": ("m", 1.0, 0.0), "mm": ("m", 1e-3, 0.0), "um": ("m", 1e-6, 0.0),
    "g": ("g", 1.0, 0.0), "mg": ("g", 1e-3, 0.0), "m/s2": ("m/s2", 1.0, 0.0),
    "count": ("count", 1.0, 0.0), "counts": ("count", 1.0, 0.0), "uT": ("uT", 1.0, 0.0),
    "nT": ("uT", 1e-3, 0.0), "tesla": ("uT", 1e6, 0.0), "gauss": ("uT", 100.0, 0.0), "mgauss": ("uT", 0.1, 0.0),
    "deg/s": ("deg/s", 1.0, 0.0), "rad/s": ("deg/s", 180 / np.pi, 0.0),
    "mdps": ("deg/s", 1e-3, 0.0),
}  # fmt: skip
SUFFIXES = {"_deg_s": "deg/s", "_v": "V", "_deg": "deg", "_c": "degC", "_s": "s", "_m": "m"}
SPELLINGS = {
    "volt": "V", "volts": "V", "millivolt": "mV", "millivolts": "mV", "°": "deg", "degree": "deg", "degrees": "deg",
    "radian": "rad", "radians": "rad", "°c": "degC", "c": "degC", "celsius": "degC", "kelvin": "K", "°f": "degF",
    "f": "degF", "fahrenheit": "degF", "sec": "s", "second": "s", "seconds": "s", "minute": "min", "minutes": "min",
    "hour": "h", "hours": "h", "hr": "h", "µs": "us", "µv": "uV", "µm": "um", "µt": "uT", "m/s^2": "m/s2",
    "m/s²": "m/s2", "m/s**2": "m/s2", "ms^-2": "m/s2", "m/(s^2)": "m/s2", "mps2": "m/s2",
    "lsb": "counts", "raw": "counts", "cnt": "counts",
    "°/s": "deg/s", "grad": "deg", "grad/s": "deg/s", "dps": "deg/s", "milli-g": "mg",
}  # fmt: skip
TRIADS = (("ax", "ay", "az"), ("mx", "my", "mz"))
RATES = ("gx", "gy", "gz")
SENSORS = (TRIADS[0], RATES, TRIADS[1])
UNIT_OF = "unit_"  # before the letter of a sensor: a constant with its unit, where it differs from that of the first
_SUFFIX = re.compile(
    r"^(?P<name>.*[^\W_])_(?P<unit>s|ms|us|ns|min|g|mg|mps2|dps|mdps|v|mv|c|degc|degf|deg|rad|ut)$", re.I
)
_IN_NAME = re.compile(r"^(?P<name>.*?)\s*(?:\((?P<round>[^()]*)\)|\[(?P<square>[^\[\]]*)\]|/\s*(?P<slash>[^\s/()]+))$")


def parse_unit(text: str) -> str:
    """The unit that `text` spells (`°C`, `m/s²`, `volts`, `mV`) in this program's spelling; "" for no known unit."""
    stripped = text.strip().strip("()[]").strip().replace("\N{GREEK SMALL LETTER MU}", "\N{MICRO SIGN}")
    if stripped in UNITS:
        return stripped
    lower = stripped.lower()
    by_lower_case = {
        unit.lower(): unit for unit in UNITS if unit.lower() != "k"
    }  # a k alone is kilo more often than kelvin
    return SPELLINGS.get(lower) or by_lower_case.get(lower, "")


def split_unit(header: str) -> tuple[str, str]:
    """`Vx (mV)`, `Vx [mV]`, `Vx / mV` or `Vx_mv` as ("Vx", "mV"); (header, "") for a header without a unit.

    One of our own names stays as it is, such as `vx_v`.
    """
    if header in NUMBERS:
        return header, ""
    match = _IN_NAME.match(header)
    if match and match["name"]:
        unit = parse_unit(match["round"] or match["square"] or match["slash"] or "")
        if unit:
            return match["name"].strip(), unit
    match = _SUFFIX.match(header)
    return (match["name"], parse_unit(match["unit"])) if match else (header, "")


def column_unit(name: str) -> str:
    """The unit of our column `name`, such as V for `vx_v`; "" where the table states it, or for a bare number."""
    return next((unit for suffix, unit in SUFFIXES.items() if name.endswith(suffix)), "")


@dataclass(frozen=True)
class ColumnMapping:
    """One column: our name, the file's name, and the file's unit ("" where it is ours)."""

    name: str
    file_column: str
    unit: str = ""

    @property
    def text(self) -> str:
        """The mapping as `--column` takes it: `vx_v=Vout:mV`."""
        return f"{self.name}={self.file_column}{f':{self.unit}' if self.unit else ''}"

    @staticmethod
    def parse(text: str) -> ColumnMapping:
        """Parse `vx_v=Vout:mV` or `vx_v=Vout`. Raises DataError."""
        name, equals, source = text.partition("=")
        before_colon, _, last = source.rpartition(":")
        unit = parse_unit(last) if before_colon else ""
        column = before_colon if unit else source
        if (
            not equals
            or not name.strip()
            or not column.strip()
            or (not before_colon and ":" in source and parse_unit(last))
        ):
            raise DataError(f'"{text}": write a column as NAME=THEIRS or NAME=THEIRS:UNIT, such as vx_v=Vout:mV')
        our_name = next((f"{name.strip()}{suffix}" for suffix in SUFFIXES if f"{name.strip()}{suffix}" in NUMBERS), "")
        if our_name and name.strip() not in NUMBERS:
            raise DataError(f'"{text}": there is no column "{name.strip()}"; did you mean "{our_name}"?')
        return ColumnMapping(name.strip(), column.strip(), unit)


def output_unit(
    mapped: Sequence[ColumnMapping], kind: str, constants: Mapping[str, Constant], source: str
) -> dict[str, Constant]:
    """The unit of the three output axes, where one is given: the magnetometer's with `triad: m` or without an
    accelerometer. Raises DataError if the axes have different units.
    """
    candidates: Sequence[Sequence[str]] = TRIADS
    if kind in ("rates", "turns"):
        candidates = (RATES,)
    elif constants.get("triad") == "m":
        candidates = TRIADS[1:]
    elif any(m.name == "ax" for m in mapped):
        candidates = TRIADS[:1]
    for axes in candidates:
        if unit := _unit_of_axes(mapped, axes, source):
            return {"unit": unit}
    return {}


def still_units(mapped: Sequence[ColumnMapping], names: Collection[str], source: str) -> dict[str, Constant]:
    """The unit of the first sensor of a still record, and of each other sensor whose unit differs. Raises DataError."""
    units = {axes[0][0]: _unit_of_axes(mapped, axes, source) for axes in SENSORS if not set(axes).isdisjoint(names)}
    first = next(iter(units.values()), "")
    others: dict[str, Constant] = {
        f"{UNIT_OF}{sensor}": unit or "count" for sensor, unit in units.items() if unit != first
    }
    return ({"unit": first} if first else {}) | others


def _unit_of_axes(mapped: Sequence[ColumnMapping], axes: Sequence[str], source: str) -> str:
    """The unit of the axes of one sensor, "" where none is given. Raises DataError for different ones."""
    stated_units = {m.name: UNITS[m.unit][0] for m in mapped if m.unit}
    units = {axis: stated_units.get(axis, "") for axis in axes}
    if len(set(units.values())) > 1:
        units_of_axes = ", ".join(f"{axis} in {unit or 'no unit'}" for axis, unit in units.items())
        raise DataError(f"{source}: the three axes must have the same unit: {units_of_axes}")
    return units[axes[0]]
