"""A text as a sheet: its layout, and its rows as numbers and texts.

numpy parses all rows in one pass, so that only the numbers take memory. Where numpy fails, rows are parsed one by one:
this accepts texts and quoted decimal commas, and names a cell that is wrong.
"""

from __future__ import annotations

import csv
import re
from array import array
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from math import isfinite
from operator import and_

import numpy as np

from calibrations.errors import DataError
from calibrations.files import Source
from calibrations.importing.cells import BadLines, Lines, is_number, number_or_text, parse_cell
from calibrations.importing.other_texts import as_lines
from calibrations.importing.units import parse_unit, split_unit
from calibrations.table import Array, Constant

EMPTY = "the file is empty: a header line with column names is missing; export the measurements again"

# How a separated text is laid out, as its first lines show: separator, header, units, constants above the header.
#
# Any separator, or JSON (`other_texts.py`); a header or none, units in the header's names or in a row below it,
# decimal commas.

HEAD_LINES = 200  # lines that the layout is taken from
MOST_WORDS = 0.1  # of the rows of a column of numbers
LONGEST_SHOWN = 20  # characters of a wrong cell
_HEXADECIMAL = re.compile(r"0[xX][0-9a-fA-F]+")
BLANK = " \t\r\n\x1a"
NAME = re.compile(r"[^\W\d][\w .()\[\]/°%^*+-]{0,39}|")  # of a column: words and a unit, or nothing
NO_UNIT = ("", "-", "1", "n/a")
Row = tuple[int, list[str]]  # the number of a line, from 1, and its cells


@dataclass(frozen=True)
class Sheet:
    """Layout of a text. `header` and `units` have one entry per column; `line` is the header's line, `first` the
    first line of data.

    Without a header (`named` is false) columns are called "1", "2", ... `width` counts the cells of a row; it
    exceeds the number of columns where a spreadsheet appended empty cells. `sample` holds the first rows.

    A binary file has its columns in `cells`, and no text; `topic` names the table in a file that has several.
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
    cells: Mapping[str, Array | tuple[str, ...]] | None = None
    topic: str = ""
    notes: tuple[str, ...] = ()
    skipped: float = 0.0  # the most of its lines that are skipped as damaged
    topics: tuple[str, ...] = ()  # all that the file has

    @property
    def place(self) -> str:
        """The header's place in messages."""
        if self.cells is None:
            return f"{self.name}, line {self.line}"
        return f"{self.name}, topic {self.topic}" if self.topic else self.name

    @property
    def name(self) -> str:
        """The name in messages."""
        return self.source.name

    @property
    def bare(self) -> tuple[str, ...]:
        """The header's names without units."""
        return tuple(split_unit(name)[0] for name in self.header)

    def rows(self, bad_lines: BadLines) -> Iterator[Row]:
        """Iterate over the rows of data without those of another width and without a cut last one, which `bad_lines`
        counts or refuses.
        """
        with self.source.lines(marked=self.skipped > 0) as opened:
            lines = Lines(islice(opened, self.first - 1, None))
            for number, cells in split_rows(lines, self.separator, self.name, self.first):
                if len(cells) == self.width and not lines.may_be_cut(cells[-1], self.sample, self.skipped > 0):
                    yield number, cells
                    continue
                if len(cells) == self.width:
                    reason = f"no line end, and {cells[-1]} may be cut"
                    remedy = "complete it and end the line, or remove it"
                    bad_lines.add(number, reason, f"{self.name}, line {number}, the last: {reason}; {remedy}")
                    continue
                spans = 1 + sum(cell.count("\n") for cell in cells)  # an open quote swallows lines
                reason = f"{len(cells)} values for {len(self.header)} columns"
                bad_lines.add(number, reason, _another_width(self.name, number, cells, self.header), spans)


def read_sheet(source: Source) -> Sheet:
    """The layout of `source`. Raises DataError with file and line."""
    source = as_lines(source)
    constants, start, head = _head(source)
    separator = _separator(head)
    rows = list(split_rows(head, separator, source.name, start + 1))
    if not rows:
        raise DataError(f"{source.name}: {EMPTY}")
    width = _width(rows)
    rows = _without_titles(rows, width, constants)
    (line, header), has_names = rows[0], not all(map(is_number, rows[0][1]))
    if has_names and len(header) != width and len(rows) > 1:
        raise DataError(_another_width(source.name, *rows[1], header))
    columns = width - _empty_behind([cells for _, cells in rows if len(cells) == width])
    header = (
        _check_header(header[:columns], f"{source.name}, line {line}")
        if has_names
        else list(map(str, range(1, width + 1)))
    )
    data_rows, units = _units(header, rows[1 if has_names else 0 :], has_names)
    if not data_rows:
        raise DataError(f"{source.name}: there are no rows below the header; export the measurements again")
    sample = _remove_damaged_rows([tuple(cells[:columns]) for _, cells in data_rows if len(cells) == width])
    if not sample:
        raise DataError(_another_width(source.name, *data_rows[0], header))
    if not any(is_number(cell) for cells in sample for cell in cells):
        raise DataError(
            f"{source.name}: has no numbers in its first rows; a table of measurements has a header line "
            "with column names, and rows of numbers below it"
        )
    return Sheet(
        source,
        separator,
        tuple(header[:columns]),
        tuple(units),
        has_names,
        width,
        line,
        data_rows[0][0],
        sample,
        constants,
    )


def _remove_damaged_rows(rows: list[tuple[str, ...]]) -> tuple[tuple[str, ...], ...]:
    """The rows without damaged ones: those with a word where nearly all others have a number."""
    is_word = [tuple(not is_number(cell) for cell in row) for row in rows]
    numeric = [sum(column) <= MOST_WORDS * len(rows) for column in zip(*is_word, strict=True)]
    fits = [row for row, words in zip(rows, is_word, strict=True) if not any(map(and_, words, numeric))]
    return tuple(fits or rows)


def split_rows(lines: Iterable[str], separator: str | None, name: str, first: int) -> Iterator[Row]:
    """The rows that are not blank; `first` is the number of the first line. Raises DataError."""
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


def _head(source: Source) -> tuple[dict[str, Constant], int, list[str]]:
    """The `# key: value` lines, their count, and the first lines below them."""
    constants: dict[str, Constant] = {}
    with source.lines(marked=True) as lines:
        for start, line in enumerate(lines):
            stripped = line.strip(BLANK)
            if stripped and not stripped.startswith("#"):
                return constants, start, [line, *islice(lines, HEAD_LINES)]
            key, colon, value = stripped.lstrip("#").rstrip(";,\t ").partition(":")
            if colon and key.strip():
                constants[key.strip()] = number_or_text(value.strip())
    raise DataError(f"{source.name}: {EMPTY}")


def _separator(head: Sequence[str]) -> str | None:
    """The separator in most lines of the second half of the head, which has no titles; None for blanks."""
    filled = [line.strip(" \r\n") for line in head if line.strip(BLANK)]
    half = filled[len(filled) // 2 :]
    return Counter(next((s for s in (";", "\t", ",") if s in line), None) for line in half).most_common(1)[0][0]


def _width(rows: Sequence[Row]) -> int:
    return Counter(len(cells) for _, cells in rows).most_common(1)[0][0]


def _without_titles(rows: list[Row], width: int, constants: dict[str, Constant]) -> list[Row]:
    """The rows without titles above the header; pairs such as `Fs,100` go to `constants`."""
    first = next((k for k, (_, cells) in enumerate(rows) if not _is_title(cells, width)), 0)
    for _, cells in rows[:first]:
        filled = [cell for cell in cells if cell]
        if len(filled) == 2:
            constants[filled[0].rstrip(":")] = number_or_text(filled[1])
    return rows[first:]


def _is_title(cells: list[str], width: int) -> bool:
    """Whether a row is narrower than the table, or filled up with empty cells by a spreadsheet."""
    if len(cells) != width:
        return len(cells) < 3 or any(map(is_number, cells)) or not all(cells)
    if width < 3 or any(cells[2:]):
        return False
    return width > 3 or not cells[1] or is_number(cells[1])


def _empty_behind(rows: Sequence[list[str]]) -> int:
    """Number of empty columns at the right end, header included."""
    ends = (next((k for k, cell in enumerate(reversed(cells)) if cell), len(cells)) for cells in rows)
    return min(ends, default=0)


def _check_header(header: list[str], place: str) -> list[str]:
    if "" in header:
        raise DataError(f"{place}: a column has no name" + _names(header, ": {}") + "; name every column")
    if 2 * sum(map(is_number, header)) > len(header):
        raise DataError(f"{place}: a header line with column names is missing; write one above the first row")
    if duplicate := next((name for name, count in Counter(header).items() if count > 1), None):
        raise DataError(f'{place}: the column "{duplicate}" occurs twice; rename one')
    return header


def _units(header: Sequence[str], rows: list[Row], has_names: bool) -> tuple[list[Row], list[str]]:
    """The rows of data, and a unit for each column: from the header, or from a row of units below it."""
    units = [split_unit(name)[1] for name in header]
    if has_names and rows and len(rows[0][1]) >= len(header) and _is_units(rows[0][1]):
        row_units = map(parse_unit, rows[0][1])
        return rows[1:], [unit or unit_below for unit, unit_below in zip(units, row_units, strict=False)]
    return rows, units


def _is_units(cells: Sequence[str]) -> bool:
    """Whether cells hold no numbers, and most of the filled ones are units."""
    filled = [cell for cell in cells if cell not in NO_UNIT]
    return (
        bool(filled) and not any(map(is_number, filled)) and 2 * sum(map(bool, map(parse_unit, filled))) >= len(filled)
    )


def _another_width(name: str, line: int, cells: Sequence[str], header: Sequence[str]) -> str:
    count = f"{len(cells)} values for {len(header)} columns{_names(header)}"
    return f"{name}, line {line}: {count}; correct this line or remove it"


def _names(header: Sequence[str], form: str = " ({})") -> str:
    """The columns' names for a message; "" where they do not look like names, so that no binary text is printed."""
    return form.format(", ".join(header)) if look_like_names(header) else ""


def look_like_names(header: Iterable[str]) -> bool:
    """Whether the header consists of words, as column names do."""
    return all(NAME.fullmatch(name) for name in header)


def read_cells(
    sheet: Sheet, texts: Collection[str], required: Collection[str] = (), report: Callable[[str], None] = lambda _: None
) -> tuple[Mapping[str, Array], Mapping[str, tuple[str, ...]]]:
    """Every column by its name in the header: columns of numbers, and the columns in `texts`.

    `report` receives a remark on damaged lines that were skipped, if the sheet allows it. Of columns in memory, those
    outside `required` that are not all finite are left out: a log has many that are unused.
    Raises DataError with file, line and column.
    """
    if sheet.cells is not None:
        return _columns_of_arrays(sheet, sheet.cells, texts, required)
    if not texts and (numbers := _number_array(sheet)) is not None:
        return dict(zip(sheet.header, numbers.T, strict=True)), {}
    bad_lines = BadLines(sheet.name, sheet.skipped)
    columns = _one_by_one(sheet, texts, bad_lines)
    bad_lines.end(report)
    return columns


def _columns_of_arrays(
    sheet: Sheet, cells: Mapping[str, Array | tuple[str, ...]], texts: Collection[str], required: Collection[str]
) -> tuple[Mapping[str, Array], Mapping[str, tuple[str, ...]]]:
    numbers, words = {}, {}
    for name, values in cells.items():
        if isinstance(values, tuple) or name in texts:
            if name in required and name not in texts:
                raise DataError(f'{sheet.place}: the column "{name}" has no numbers; choose another column')
            words[name] = values if isinstance(values, tuple) else tuple(f"{v:g}" for v in values)
        elif np.isfinite(values).all():
            numbers[name] = values
        elif name in required:
            row = int(np.flatnonzero(~np.isfinite(values))[0])
            raise DataError(
                f'{sheet.place}, row {row + 1}, column "{name}": {values[row]} is not a finite number; '
                "correct the value or remove the row"
            )
    return numbers, words


def _number_array(sheet: Sheet) -> Array | None:
    """All cells as numbers, shape (rows, columns); None if a cell is not a number."""
    if len(sheet.header) != sheet.width:
        return None
    comma = sheet.separator != "," and any("," in cell for row in sheet.sample for cell in row)
    with sheet.source.lines() as opened:
        lines = Lines(opened)
        numeric = (line.replace(",", ".") for line in lines) if comma else lines.in_batches()
        try:
            for _ in range(sheet.first - 1):
                next(numeric)
            first = next(numeric)  # numpy warns of an iterator without any
            numbers = np.loadtxt(
                chain([first], numeric), delimiter=sheet.separator, ndmin=2, comments=None, quotechar='"'
            )
        except UnicodeError:
            if sheet.skipped:
                return None
            raise
        except ValueError:
            return None
    if lines.may_be_cut(
        lines.last.rstrip(BLANK).split(sheet.separator)[-1].strip(BLANK + '"'), sheet.sample, sheet.skipped > 0
    ):
        return None
    return numbers if numbers.shape[1] == sheet.width and np.isfinite(numbers).all() else None


def _one_by_one(
    sheet: Sheet, texts: Collection[str], bad_lines: BadLines
) -> tuple[Mapping[str, Array], Mapping[str, tuple[str, ...]]]:
    numbers = {name: array("d") for name in sheet.header if name not in texts}
    words: dict[str, list[str]] = {name: [] for name in sheet.header if name in texts}
    numeric = [(k, numbers[name]) for k, name in enumerate(sheet.header) if name in numbers]
    for row in sheet.rows(bad_lines):
        try:
            values = [_number(sheet, row, k) for k, _ in numeric]
        except DataError as error:
            is_header = tuple(row[1][: len(sheet.header)]) == sheet.header
            bad_lines.add(row[0], "the header again" if is_header else _damage_words(sheet, row), str(error))
            continue
        bad_lines.good += 1
        for (_, column), value in zip(numeric, values, strict=True):
            column.append(value)
        for k, name in enumerate(sheet.header):
            if name in words:
                words[name].append(row[1][k])
    return (
        {name: np.frombuffer(values, dtype=np.float64) for name, values in numbers.items()},
        {name: tuple(values) for name, values in words.items()},
    )


def _damage_words(sheet: Sheet, row: Row) -> str:
    """The first cell of a damaged row that is not a number, in words."""
    k = next((k for k in range(len(sheet.header)) if not is_number(row[1][k])), 0)
    return f"{sheet.header[k]} is {row[1][k][:LONGEST_SHOWN]!r}"


def _number(sheet: Sheet, row: Row, k: int) -> float:
    """The number in cell `k`. Raises DataError with line and column."""
    line, cells = row
    try:
        value = parse_cell(cells[k])
    except ValueError:
        reason = f'"{cells[k]}" where a number belongs' if cells[k] else "empty where a number belongs"
        if _HEXADECIMAL.fullmatch(cells[k]):
            reason = f'"{cells[k]}" is hexadecimal, and a decimal number belongs here'
    else:
        if isfinite(value):
            return value
        reason = f'"{cells[k]}" is not a finite number'
    place = f'{sheet.name}, line {line}, column "{sheet.header[k]}"'
    raise DataError(f"{place}: {reason}; correct the cell or remove the row")
