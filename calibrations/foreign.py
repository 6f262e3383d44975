"""Other people's text tables: any separator, with or without a header, their names and units mapped to ours.

A column is named by their header, or by its number from 1 where there is none. Units are those of the target column
(V, deg, degC, s); outputs of `positions` may be in any unit, which the table then carries.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibrations.errors import DataError, MissingColumn, nearest
from calibrations.separated import Text, number_or_text, parse
from calibrations.table import KINDS, OPTIONAL, Array, Constant, Table, guess_kind

# unit -> (unit of the target column, factor, offset)
UNITS: Mapping[str, tuple[str, float, float]] = {
    "V": ("V", 1.0, 0.0), "mV": ("V", 1e-3, 0.0), "uV": ("V", 1e-6, 0.0),
    "deg": ("deg", 1.0, 0.0), "rad": ("deg", 180 / np.pi, 0.0), "mrad": ("deg", 0.18 / np.pi, 0.0),
    "degC": ("degC", 1.0, 0.0), "K": ("degC", 1.0, -273.15), "degF": ("degC", 5 / 9, -160 / 9),
    "s": ("s", 1.0, 0.0), "ms": ("s", 1e-3, 0.0), "us": ("s", 1e-6, 0.0),
    "min": ("s", 60.0, 0.0), "h": ("s", 3600.0, 0.0),
    "m": ("m", 1.0, 0.0), "mm": ("m", 1e-3, 0.0), "um": ("m", 1e-6, 0.0),
    "g": ("g", 1.0, 0.0), "mg": ("g", 1e-3, 0.0), "m/s2": ("m/s2", 1.0, 0.0),
    "count": ("count", 1.0, 0.0), "counts": ("count", 1.0, 0.0), "uT": ("uT", 1.0, 0.0),
    "deg/s": ("deg/s", 1.0, 0.0), "rad/s": ("deg/s", 180 / np.pi, 0.0),
}  # fmt: skip
SUFFIXES = {"_deg_s": "deg/s", "_v": "V", "_deg": "deg", "_c": "degC", "_s": "s", "_m": "m"}
NUMERIC = {name for sets in KINDS.values() for wanted in sets for name in wanted} | set(OPTIONAL) - {"path"}


@dataclass(frozen=True)
class Mapped:
    """One column: our name, theirs, and their unit ("" where it is ours already)."""

    name: str
    theirs: str
    unit: str = ""

    @staticmethod
    def parse(text: str) -> Mapped:
        """From `vx_v=Vout:mV` or `vx_v=Vout`. Raises DataError."""
        name, equals, rest = text.partition("=")
        theirs, _, unit = rest.rpartition(":") if rest.rpartition(":")[2] in UNITS else (rest, "", "")
        if not equals or not name.strip() or not theirs.strip():
            raise DataError(f'"{text}": a column is given as NAME=THEIRS or NAME=THEIRS:UNIT, such as vx_v=Vout:mV')
        return Mapped(name.strip(), theirs.strip(), unit.strip())


def read_foreign(
    path: Path, kind: str | None, mapped: Sequence[Mapped] = (), constants: Mapping[str, Constant] | None = None
) -> Table:
    """The table in the file `path`. Mapped columns take our names; others keep those that a header gives them.

    Raises DataError naming file, line and column.
    """
    text = parse(path)
    known = {**text.constants, **(constants or {})}
    columns: dict[str, Array] = {}
    for m in mapped:
        if m.name in columns:
            raise DataError(f'{path}: the column "{m.name}" is given twice')
        columns[m.name] = _converted(_theirs(text, m), m, path)
    if unit := _output_unit(mapped, path):
        known["unit"] = unit
    labels = {}
    for name in text.others({m.theirs for m in mapped} | set(columns)):
        if name in NUMERIC or isinstance(number_or_text(text.cells(name)[0]), float):
            columns[name] = text.numbers(name)
        else:
            labels[name] = tuple(text.cells(name))
    try:
        kind = kind or guess_kind(columns)
    except DataError as error:
        raise DataError(f"{path}: {error}; --column gives one of yours the name, as in vx_v=Vout:mV") from None
    return Table.from_columns(kind, columns, known, str(path), labels)


def _theirs(text: Text, m: Mapped) -> Array:
    """The column that `m` names. Raises MissingColumn, or DataError for a unit that nobody here knows."""
    if m.theirs in text.header:
        return text.numbers(m.theirs)
    name, _, unit = m.theirs.rpartition(":")
    if not m.unit and name in text.header:
        raise DataError(f'{text.path}: unknown unit "{unit}" of the column "{name}"{nearest(unit, UNITS)}')
    raise MissingColumn(f'{text.path}: there is no column "{m.theirs}"{nearest(m.theirs, text.header)}')


def _converted(values: Array, m: Mapped, path: Path) -> Array:
    """Values in the target column's unit."""
    if not m.unit:
        return values
    target, factor, offset = UNITS[m.unit]
    own = next((unit for suffix, unit in SUFFIXES.items() if m.name.endswith(suffix)), None)
    if own is not None and target != own:
        raise DataError(f'{path}: the column "{m.name}" is in {own}; "{m.theirs}" in {m.unit} cannot become that')
    return values * factor + offset


def _output_unit(mapped: Sequence[Mapped], path: Path) -> str:
    """The unit of the three axes, "" where none is given. Raises DataError where they differ."""
    for axes in (("ax", "ay", "az"), ("mx", "my", "mz")):
        units = {m.name: UNITS[m.unit][0] if m.unit else "" for m in mapped if m.name in axes}
        if len(set(units.values())) > 1:
            said = ", ".join(f"{name} in {unit or 'no unit'}" for name, unit in units.items())
            raise DataError(f"{path}: the three axes must be in one unit: {said}")
        if units:
            return next(iter(units.values()))
    return ""
