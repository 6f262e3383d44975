"""Separated text as others write it: any separator, a header or none, decimal commas, gzip, constants on top."""

from __future__ import annotations

import csv
import gzip
import io
import re
import zlib
from collections import Counter
from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from calibrations.errors import DataError
from calibrations.table import Array, Constant


@dataclass(frozen=True)
class Text:
    """A file as text: column names ("1", "2", ... where it has none), and each row's line and cells."""

    path: Path
    header: list[str]
    rows: list[list[str]]
    lines: list[int]
    constants: dict[str, Constant]

    @cached_property
    def _all(self) -> Array | None:
        """All cells as numbers, shape (rows, columns); None where one is none."""
        try:
            cells = np.loadtxt(io.StringIO("\n".join("\t".join(row) for row in self.rows)), delimiter="\t", ndmin=2)
        except ValueError:
            return None
        return cells if np.isfinite(cells).all() else None

    def others(self, taken: Set[str]) -> list[str]:
        """The columns that the header names and that are not `taken`; all of them, where nothing is taken."""
        named = [name for name in self.header if not name.isdecimal()]
        return [name for name in named if name not in taken] if taken else self.header

    def cells(self, name: str) -> list[str]:
        """One column as text."""
        k = self.header.index(name)
        return [row[k] for row in self.rows]

    def numbers(self, name: str) -> Array:
        """One column as numbers. Raises DataError naming line and column."""
        if self._all is not None:
            return self._all[:, self.header.index(name)]
        values = np.array([_number(cell) for cell in self.cells(name)])
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            where = f'{self.path}, line {self.lines[bad[0]]}, column "{name}"'
            raise DataError(
                f'{where}: "{self.cells(name)[bad[0]]}" where a number belongs; correct it or remove the row'
            )
        return values


def parse(path: Path) -> Text:
    """The file as text, split at the separator that it uses. Raises DataError naming file and line."""
    lines = _lines(path)
    start = next((k for k, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")), len(lines))
    constants: dict[str, Constant] = {}
    for line in lines[:start]:
        key, colon, value = line.strip().lstrip("#").partition(":")
        if colon:
            constants[key.strip()] = number_or_text(value.strip())
    split = _splitter(lines[start:])
    try:
        body = [(number, split(line)) for number, line in enumerate(lines[start:], start + 1) if line.strip()]
    except csv.Error as error:
        raise DataError(f"{path}: cannot be split into columns: {error}") from None
    if not body:
        raise DataError(f"{path}: the file is empty")
    width = Counter(len(cells) for _, cells in body).most_common(1)[0][0]
    # lines above the header that have another number of cells, such as `Fs,100`, are constants too
    while len(body[0][1]) != width:
        above = body.pop(0)[1]
        if len(above) == 2:
            constants[above[0]] = number_or_text(above[1])
    header = [str(k + 1) for k in range(width)]
    if not np.isfinite([_number(cell) for cell in body[0][1]]).all():
        first, header = body.pop(0)
        if len(set(header)) < len(header) or not all(header):
            raise DataError(f"{path}, line {first}: column names must be there and differ: {', '.join(header)}")
    if not body:
        raise DataError(f"{path}: no rows below the header")
    for number, cells in body:
        if len(cells) != width:
            raise DataError(f"{path}, line {number}: {len(cells)} values for {width} columns ({', '.join(header)})")
    return Text(path, header, [cells for _, cells in body], [number for number, _ in body], constants)


def _lines(path: Path) -> list[str]:
    try:
        raw = gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes()
        return raw.decode("utf-8-sig").splitlines()
    except (OSError, EOFError, zlib.error, UnicodeDecodeError) as error:
        raise DataError(f"{path}: cannot be read as text: {error}") from None


def _splitter(body: Sequence[str]) -> Callable[[str], list[str]]:
    """A function that splits a line at the separator that the file uses."""
    filled = [line for line in body if line.strip()] or [""]
    separator = next((s for s in (";", "\t", ",") if s in filled[len(filled) // 2]), None)
    if separator is None:
        return str.split
    return lambda line: [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]


def _number(cell: str) -> float:
    """The number in a cell, whose decimal point may be a comma; NaN where there is none."""
    number = number_or_text(re.sub(r",(?=\d+([eE]|$))", ".", cell))
    return number if isinstance(number, float) else np.nan


def number_or_text(text: str) -> Constant:
    """A number where it is one."""
    try:
        return float(text)
    except ValueError:
        return text
