"""How a separated text is laid out, as its first lines show: separator, header, units, constants above the header.

Any separator, or JSON (`json_arrays.py`); a header or none, units in the header's names or in a row below it, decimal
commas. The rows themselves are read by `calibrations/reading/cells.py`.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

from calibrations.errors import DataError
from calibrations.reading.json_arrays import as_lines
from calibrations.reading.text_file import Source
from calibrations.reading.units import name_and_unit, unit_of
from calibrations.table import Constant

HEAD = 200  # lines that the layout is taken from
BLANK = " \t\r\n\x1a"
_COMMA = re.compile(r",(?=\d+([eE]|$))")
NAME = re.compile(r"[^\W\d][\w .()\[\]/°%^*+-]{0,39}|")  # of a column: words and a unit, or nothing
NO_UNIT = ("", "-", "1", "n/a")
Row = tuple[int, list[str]]  # the number of a line, from 1, and its cells


@dataclass(frozen=True)
class Sheet:
    """A text's layout. `header` and `units` have one entry a column; `line` is that of the header, `first` that of
    the first row of data.

    Without a header (`named` is false) columns are called "1", "2", ... `width` counts cells of a row: it is greater
    than the number of columns where a spreadsheet wrote empty ones behind them. `sample` holds the first rows.
    """

    source: Source
    separator: str | None
    header: tuple[str, ...]
    units: tuple[str, ...]
    named: bool
    width: int
    line: int
    first: int
    sample: tuple[tuple[str, ...], ...]
    constants: dict[str, Constant]

    @property
    def name(self) -> str:
        """What messages call it."""
        return self.source.name

    @property
    def bare(self) -> tuple[str, ...]:
        """The header's names without the units in them."""
        return tuple(name_and_unit(name)[0] for name in self.header)

    def rows(self) -> Iterator[Row]:
        """Every row of data, a few in memory at a time. Raises DataError for one of another width."""
        with self.source.lines() as lines:
            for number, cells in split(islice(lines, self.first - 1, None), self.separator, self.name, self.first):
                if len(cells) != self.width:
                    raise DataError(_another_width(self.name, number, cells, self.header))
                yield number, cells


def sheet(source: Source) -> Sheet:
    """The layout of `source`. Raises DataError naming file and line."""
    source = as_lines(source)
    constants, start, head = _head(source)
    separator = _separator(head)
    rows = list(split(head, separator, source.name, start + 1))
    if not rows:
        raise DataError(f"{source.name}: the file is empty: a header line with column names is missing")
    width = _width(rows)
    rows = _without_titles(rows, width, constants)
    (line, header), named = rows[0], not all(map(is_number, rows[0][1]))
    if named and len(header) != width and len(rows) > 1:
        raise DataError(_another_width(source.name, *rows[1], header))
    columns = width - _empty_behind([cells for _, cells in rows if len(cells) == width])
    header = _checked(header[:columns], f"{source.name}, line {line}") if named else list(map(str, range(1, width + 1)))
    below, units = _units(header, rows[1 if named else 0 :], named)
    if not below:
        raise DataError(f"{source.name}: no rows below the header")
    sample = tuple(tuple(cells[:columns]) for _, cells in below if len(cells) == width)
    if not sample:
        raise DataError(_another_width(source.name, *below[0], header))
    if not any(is_number(cell) for cells in sample for cell in cells):
        raise DataError(
            f"{source.name}: holds no numbers in its first {len(sample)} rows; a table of measurements has a header "
            "line with column names, and rows of numbers below it"
        )
    return Sheet(
        source, separator, tuple(header[:columns]), tuple(units), named, width, line, below[0][0], sample, constants
    )


def split(lines: Iterable[str], separator: str | None, name: str, first: int) -> Iterator[Row]:
    """The rows that are not blank. `first` is the number of the first line. Raises DataError."""
    if separator is None:
        yield from ((k, line.split()) for k, line in enumerate(lines, first) if line.strip(BLANK))
        return
    reader = csv.reader(lines, delimiter=separator)
    try:
        for row in reader:
            cells = [cell.strip(BLANK) for cell in row]
            if any(cells):
                yield first + reader.line_num - 1, cells
    except csv.Error as error:
        raise DataError(f"{name}: cannot be split into columns: {error}") from None


def number(cell: str) -> float:
    """The number in a cell, whose decimal point may be a comma. Raises ValueError where there is none."""
    if "_" in cell:
        raise ValueError(cell)  # float() would take 1_000
    return float(_COMMA.sub(".", cell) if "," in cell else cell)


def is_number(cell: str) -> bool:
    """Whether a number stands in a cell; "nan" and the like are none."""
    return isinstance(value := number_or_text(cell), float) and abs(value) != float("inf") and value == value


def number_or_text(cell: str) -> Constant:
    """A number where it is one."""
    try:
        return number(cell)
    except ValueError:
        return cell


def _head(source: Source) -> tuple[dict[str, Constant], int, list[str]]:
    """The `# key: value` lines, how many lines stand above the others, and the first of the others."""
    constants: dict[str, Constant] = {}
    with source.lines() as lines:
        for start, line in enumerate(lines):
            plain = line.strip(BLANK)
            if plain and not plain.startswith("#"):
                return constants, start, [line, *islice(lines, HEAD)]
            key, colon, value = plain.lstrip("#").rstrip(";,\t ").partition(":")
            if colon and key.strip():
                constants[key.strip()] = number_or_text(value.strip())
    raise DataError(f"{source.name}: the file is empty: a header line with column names is missing")


def _separator(head: Sequence[str]) -> str | None:
    """The separator that a line in the middle holds; None for blanks."""
    filled = [line for line in head if line.strip(BLANK)]
    return next((s for s in (";", "\t", ",") if s in filled[len(filled) // 2].strip(" \r\n")), None)


def _width(rows: Sequence[Row]) -> int:
    return Counter(len(cells) for _, cells in rows).most_common(1)[0][0]


def _without_titles(rows: list[Row], width: int, constants: dict[str, Constant]) -> list[Row]:
    """The rows without those above the header, such as a title or `Fs,100`; pairs go to `constants`."""
    first = next((k for k, (_, cells) in enumerate(rows) if not _is_title(cells, width)), 0)
    for _, cells in rows[:first]:
        filled = [cell for cell in cells if cell]
        if len(filled) == 2:
            constants[filled[0].rstrip(":")] = number_or_text(filled[1])
    return rows[first:]


def _is_title(cells: list[str], width: int) -> bool:
    """Whether a row is narrower than the table, or a spreadsheet filled it up with empty cells to be as wide."""
    if len(cells) != width:
        return len(cells) < 3 or any(map(is_number, cells)) or not all(cells)
    if width < 3 or any(cells[2:]):
        return False
    return width > 3 or not cells[1] or is_number(cells[1])


def _empty_behind(rows: Sequence[list[str]]) -> int:
    """How many columns at the end are empty throughout, header included."""
    ends = (next((k for k, cell in enumerate(reversed(cells)) if cell), len(cells)) for cells in rows)
    return min(ends, default=0)


def _checked(header: list[str], where: str) -> list[str]:
    if "" in header:
        raise DataError(f"{where}: a column has no name" + _names(header, ": {}"))
    if twice := next((name for name in header if header.count(name) > 1), None):
        raise DataError(f'{where}: the column "{twice}" occurs twice')
    return header


def _units(header: Sequence[str], rows: list[Row], named: bool) -> tuple[list[Row], list[str]]:
    """The rows of data, and a unit for each column: of the header's name, or of a row of units below it."""
    units = [name_and_unit(name)[1] for name in header]
    if named and rows and len(rows[0][1]) >= len(header) and _is_units(rows[0][1]):
        below = map(unit_of, rows[0][1])
        return rows[1:], [unit or other for unit, other in zip(units, below, strict=False)]
    return rows, units


def _is_units(cells: Sequence[str]) -> bool:
    """No numbers, and most of what is said is a unit."""
    said = [cell for cell in cells if cell not in NO_UNIT]
    return bool(said) and not any(map(is_number, said)) and 2 * sum(map(bool, map(unit_of, said))) >= len(said)


def _another_width(name: str, line: int, cells: Sequence[str], header: Sequence[str]) -> str:
    return f"{name}, line {line}: {len(cells)} values for {len(header)} columns{_names(header)}"


def _names(header: Sequence[str], told: str = " ({})") -> str:
    """The columns' names for a message; "" where they hardly are names: nothing of a file that is no table is told."""
    return told.format(", ".join(header)) if look_like_names(header) else ""


def look_like_names(header: Iterable[str]) -> bool:
    """Whether a header names columns, as far as letters tell."""
    return all(NAME.fullmatch(name) for name in header)
