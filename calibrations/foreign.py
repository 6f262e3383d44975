"""Other people's text tables: any separator, with or without a header, their names and units mapped to ours.

A column is named by their header, or by its number from 1 where there is none. Units are those of the target column
(V, deg, degC, s); outputs of `positions` may be in any unit, which the table then carries.
"""

from __future__ import annotations

import csv
import gzip
import io
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibrations.errors import DataError, MissingColumn, nearest
from calibrations.table import Array, Constant, Table, guess_kind

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
SUFFIXES = {"_v": "V", "_deg": "deg", "_c": "degC", "_s": "s", "_m": "m"}


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
    """The table in the file `path`, its columns mapped. Raises DataError naming file, line and column."""
    header, rows, found, first = _read(path)
    columns = _columns(header, rows, path, first)
    known = {**found, **(constants or {})}
    if not mapped:
        return Table.from_columns(kind or guess_kind(header), columns, known, str(path))
    chosen: dict[str, Array] = {}
    for m in mapped:
        if m.theirs not in columns:
            raise MissingColumn(f'{path}: there is no column "{m.theirs}"{nearest(m.theirs, header)}')
        chosen[m.name], unit = _converted(columns[m.theirs], m, path)
        if unit and m.name in ("ax", "ay", "az", "mx", "my", "mz"):
            known["unit"] = unit
    return Table.from_columns(kind or guess_kind(chosen), chosen, known, str(path))


def _converted(values: Array, m: Mapped, path: Path) -> tuple[Array, str]:
    """Values in the target column's unit, and that unit."""
    if not m.unit:
        return values, ""
    target, factor, offset = UNITS[m.unit]
    own = next((unit for suffix, unit in SUFFIXES.items() if m.name.endswith(suffix)), None)
    if own is not None and target != own:
        raise DataError(f'{path}: the column "{m.name}" is in {own}; "{m.theirs}" in {m.unit} cannot become that')
    return values * factor + offset, target


def _read(path: Path) -> tuple[list[str], list[list[str]], dict[str, Constant], int]:
    """Header, cells, constants, and the line of the first row."""
    try:
        raw = gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes()
        lines = raw.decode("utf-8-sig").splitlines()
    except (OSError, EOFError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: cannot be read as text: {error}") from None
    constants: dict[str, Constant] = {}
    skipped = 0
    while skipped < len(lines) and (not lines[skipped].strip() or lines[skipped].lstrip().startswith("#")):
        key, colon, value = lines[skipped].strip().lstrip("#").partition(":")
        if colon:
            constants[key.strip()] = _number_or_text(value.strip())
        skipped += 1
    body = lines[skipped:]
    if not body:
        raise DataError(f"{path}: the file is empty")
    split = _splitter(body)
    # lines above the header that have another number of cells, such as `Fs,100`, are constants too
    width = len(split(body[-1]))
    while len(split(body[0])) != width and len(body) > 1:
        cells = split(body.pop(0))
        skipped += 1
        if len(cells) == 2:
            constants[cells[0]] = _number_or_text(cells[1])
    if all(isinstance(_number_or_text(cell), float) for cell in split(body[0])):
        header = [str(k + 1) for k in range(width)]
    else:
        header = split(body.pop(0))
        skipped += 1
    if len(set(header)) < len(header) or not all(header):
        raise DataError(f"{path}, line {skipped}: column names must be there and differ: {', '.join(header)}")
    rows = [split(line) for line in body if line.strip()]
    if not rows:
        raise DataError(f"{path}: no rows below the header")
    return header, rows, constants, skipped + 1


def _splitter(body: Sequence[str]) -> Callable[[str], list[str]]:
    """A function that splits a line at the separator that the file uses."""
    separator = next((s for s in (";", "\t", ",") if s in body[len(body) // 2]), None)
    if separator is None:
        return str.split
    return lambda line: [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]


def _columns(header: Sequence[str], rows: Sequence[Sequence[str]], path: Path, first: int) -> dict[str, Array]:
    for number, row in enumerate(rows, start=first):
        if len(row) != len(header):
            raise DataError(f"{path}, line {number}: {len(row)} values for {len(header)} columns")
    try:
        cells = np.loadtxt(io.StringIO("\n".join("\t".join(row) for row in rows)), delimiter="\t", ndmin=2)
        return {name: cells[:, k] for k, name in enumerate(header)}
    except ValueError:
        return {name: _numbers([row[k] for row in rows], path, name, first) for k, name in enumerate(header)}


def _numbers(cells: Sequence[str], path: Path, name: str, first: int) -> Array:
    values = np.empty(len(cells))
    for i, cell in enumerate(cells):
        number = _number_or_text(re.sub(r",(?=\d+$)", ".", cell))
        if isinstance(number, str):
            raise DataError(f'{path}, line {first + i}, column "{name}": "{cell}" where a number belongs')
        values[i] = number
    return values


def _number_or_text(text: str) -> Constant:
    try:
        return float(text)
    except ValueError:
        return text
