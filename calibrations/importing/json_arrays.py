"""A JSON file of measurements as the lines of a table: named arrays of equal length, or a list of named values.

    {"mag": [[-17.2, -2.1, 47.0], ...], "t_s": [0.0, ...], "unit": "uT"}      mag_x, mag_y, mag_z, t_s; # unit: uT
    [{"mx": -17.2, "my": -2.1, "mz": 47.0}, ...]                              or a value a line: {...} {...}

An array of triples is three columns, by axis; of other lists, columns by number from 1. What is no array is a
constant.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator
from itertools import chain
from typing import Any

from calibrations.errors import DataError
from calibrations.files import Source, text_source

LONGEST_JSON = 1 << 26  # characters: a whole document is held in memory
AXES = ("x", "y", "z")
JSON_FORM = 'give arrays of equal length, {"mag": [[1, 2, 3], ...]}, or [{"mx": 1, ...}, ...]'


def json_as_lines(source: Source) -> Source:
    """The JSON document of `source` as comma-separated lines; another text unchanged. Raises DataError."""
    with source.lines() as lines:
        text = "".join(_limit_length(lines, source.name))
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        document = _by_lines(text)
    if document is None:
        if source.name.endswith(".json"):
            raise DataError(f"{source.name}: is not valid JSON; {JSON_FORM}")
        return source
    return text_source(_csv_text(document, source.name), source.name)


def _by_lines(text: str) -> Any:
    """The documents of single lines as a list; None if a line is none."""
    try:
        return [json.loads(line) for line in text.splitlines() if line.strip()]
    except (ValueError, RecursionError):
        return None


def _limit_length(lines: Iterator[str], name: str) -> Iterator[str]:
    size = 0
    for line in lines:
        size += len(line)
        if size > LONGEST_JSON:
            raise DataError(f"{name}: has more than {LONGEST_JSON >> 20} million characters of JSON; save it as CSV")
        yield line


def _csv_text(document: Any, name: str) -> str:
    if isinstance(document, list) and document and all(isinstance(row, dict) for row in document):
        document = {key: [row.get(key) for row in document] for key in document[0]}
    arrays = {k: v for k, v in document.items() if isinstance(v, list) and v} if isinstance(document, dict) else {}
    if not arrays:
        raise DataError(f"{name}: has no arrays of measurements; {JSON_FORM}")
    lengths = {key: len(values) for key, values in arrays.items()}
    if len(set(lengths.values())) > 1:
        raise DataError(f"{name}: arrays of different length: {lengths}")
    columns = dict(chain.from_iterable(_columns(key, values, name) for key, values in arrays.items()))
    text = io.StringIO()
    text.writelines(
        f"# {key}: {value}\n" for key, value in document.items() if isinstance(value, (str, int, float)) and value != ""
    )
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return text.getvalue()


def _columns(key: str, values: list[Any], name: str) -> Iterator[tuple[str, list[Any]]]:
    """The columns of one array. Raises DataError for rows of different length."""
    if not isinstance(values[0], list):
        yield key, values
        return
    width = len(values[0])
    wrong_row = next((k for k, row in enumerate(values) if not isinstance(row, list) or len(row) != width), None)
    if wrong_row is not None:
        raise DataError(
            f'{name}: row {wrong_row + 1} of "{key}" does not have {width} numbers like the first row; {JSON_FORM}'
        )
    names = AXES if width == len(AXES) else [str(k + 1) for k in range(width)]
    for place, end in enumerate(names):
        yield f"{key}_{end}", [row[place] for row in values]
