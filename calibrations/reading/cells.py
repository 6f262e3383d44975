"""The rows of a sheet as numbers and texts.

numpy parses all rows at once, a line at a time, so that only the numbers take memory. Where it cannot, rows are read
one by one: that takes texts and quoted decimal commas too, and names the cell at fault.
"""

from __future__ import annotations

from array import array
from collections.abc import Collection, Mapping
from itertools import chain
from math import isfinite

import numpy as np

from calibrations.errors import DataError
from calibrations.reading.separated import Row, Sheet, number
from calibrations.table import Array


def cells(sheet: Sheet, texts: Collection[str]) -> tuple[Mapping[str, Array], Mapping[str, tuple[str, ...]]]:
    """Every column by the header's name: those of numbers, and those called `texts`.

    Raises DataError naming file, line and column.
    """
    if not texts and (numbers := _at_once(sheet)) is not None:
        return dict(zip(sheet.header, numbers.T, strict=True)), {}
    return _one_by_one(sheet, texts)


def _at_once(sheet: Sheet) -> Array | None:
    """All cells as numbers, shape (rows, columns); None where one is none."""
    if len(sheet.header) != sheet.width:
        return None
    comma = sheet.separator != "," and any("," in cell for row in sheet.sample for cell in row)
    with sheet.source.lines() as lines:
        for _ in range(sheet.first - 1):
            next(lines)
        given = (line.replace(",", ".") for line in lines) if comma else lines
        try:
            first = next(given)  # numpy warns of an iterator without any
            numbers = np.loadtxt(
                chain([first], given), delimiter=sheet.separator, ndmin=2, comments=None, quotechar='"'
            )
        except UnicodeError:
            raise
        except ValueError:
            return None
    return numbers if numbers.shape[1] == sheet.width and np.isfinite(numbers).all() else None


def _one_by_one(sheet: Sheet, texts: Collection[str]) -> tuple[Mapping[str, Array], Mapping[str, tuple[str, ...]]]:
    numbers = {name: array("d") for name in sheet.header if name not in texts}
    words: dict[str, list[str]] = {name: [] for name in sheet.header if name in texts}
    places = list(enumerate(sheet.header))
    for row in sheet.rows():
        for k, name in places:
            if name in words:
                words[name].append(row[1][k])
            else:
                numbers[name].append(_number(sheet, row, k))
    return (
        {name: np.frombuffer(values, dtype=np.float64) for name, values in numbers.items()},
        {name: tuple(values) for name, values in words.items()},
    )


def _number(sheet: Sheet, row: Row, k: int) -> float:
    """The number in cell `k`. Raises DataError with its place."""
    line, cells = row
    try:
        value = number(cells[k])
    except ValueError:
        what = f'"{cells[k]}" where a number belongs' if cells[k] else "empty where a number belongs"
    else:
        if isfinite(value):
            return value
        what = f'"{cells[k]}" is not a finite number'
    where = f'{sheet.name}, line {line}, column "{sheet.header[k]}"'
    raise DataError(f"{where}: {what}; correct the cell or remove the row")
