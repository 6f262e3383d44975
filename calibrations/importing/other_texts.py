"""Texts that are no table: JSON documents and lines of named values become one, other known formats are refused.

    {"mag": [[-17.2, -2.1, 47.0], ...], "t_s": [0.0, ...], "unit": "uT"}      mag_x, mag_y, mag_z, t_s; # unit: uT
    [{"mx": -17.2, "my": -2.1, "mz": 47.0}, ...]                              or a value a line: {...} {...}
    ax:0.1,ay:0.2,az:9.8                                                      ax, ay, az

An array of triples is three columns, by axis; of other lists, columns by number from 1. A value of a JSON document that
is not an array is a constant.
"""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Iterator, Mapping
from itertools import chain
from typing import Any

from calibrations.errors import DataError
from calibrations.files import Source, text_source
from calibrations.table import AXES

NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|nan"
PAIR = rf"(?P<name>[A-Za-z_][\w.]*)\s*[:=]\s*(?P<value>{NUMBER})(?=[,;\s]|$)"
NAMED_VALUE = re.compile(PAIR)
_ANOTHER = re.sub(r"\?P<\w+>", "", PAIR)
NAMED_LINE = re.compile(rf"\s*{_ANOTHER}(?:[,;\s]+{_ANOTHER})+\s*")
LONGEST = 1 << 26  # characters: the text is held in memory
REFUSED_FORMATS: Mapping[str, str] = {  # by a pattern of the first line: the format, and the remedy
    r"FMT, ?128, ?": "is a DataFlash log as text; import the .bin log that it was made from",
    r"version https://git-lfs": "is a pointer of Git LFS, not the file; get it with `git lfs pull`",
    r"<(!doctype|html)": "is a web page, not measurements; download the file itself",
    r"LabVIEW Measurement": (
        "is a LabVIEW measurement file; remove the lines above the one that begins with X_Value, and import the rest"
    ),
    r"\(\d+\.\d+\) \w+ [0-9A-F]+#": "is a CAN log; decode its frames to a CSV file with one column for each signal",
    r"\$\w+,.*\*[0-9A-F]{2}\s*$": (
        "has NMEA sentences; remove `$` and the name before, and `*` and the checksum behind the values of each line. "
        "The driver imu_lines reads such a sensor directly"
    ),
    r">\w+:[\d.]+(:[-\d.]+)?": (
        "is a Teleplot log with one value a line; save it as CSV. The driver imu_lines reads such a sensor directly"
    ),
    r"\[\d[^\]]*:\d\d[^\]]*\]": (
        "begins each line with a time in brackets; replace `[` by nothing and `]` by a comma, and add a header line"
    ),
}


def as_lines(source: Source) -> Source:
    """The source itself, or its JSON document or lines of named values as comma-separated lines.

    Raises DataError for a known format that is no table.
    """
    with source.lines(marked=True) as lines:
        first = next((line for line in lines if line.strip()), "").lstrip()
    if first.startswith(("{", "[")) and (document := _json_as_lines(source)) is not source:
        return document
    for form, reason in REFUSED_FORMATS.items():
        if re.match(form, first, re.IGNORECASE):
            raise DataError(f"{source.name}: {reason}")
    if not NAMED_LINE.fullmatch(first):
        return source
    names = [match["name"] for match in NAMED_VALUE.finditer(first)]
    with source.lines(marked=True) as lines:
        rows = list(_rows(lines, names, source.name))
    return text_source("".join([",".join(names) + "\n", *rows]), source.name)


def _rows(lines: Iterator[str], names: list[str], name: str) -> Iterator[str]:
    """The values of each line, with its line end; a damaged line as it is, which the table then counts."""
    for line in filter(str.strip, _limit_length(lines, name)):
        found = {match["name"]: match["value"] for match in NAMED_VALUE.finditer(line)}
        row = ",".join(found.values()) if list(found) == names else line.strip()
        yield row + "\n" if line.endswith("\n") else row


# A JSON document.


JSON_FORM = 'give arrays of equal length, {"mag": [[1, 2, 3], ...]}, or [{"mx": 1, ...}, ...]'


def _json_as_lines(source: Source) -> Source:
    """The JSON document of `source` as comma-separated lines; another text unchanged. Raises DataError."""
    with source.lines() as lines:
        text = "".join(_limit_length(lines, source.name))
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        document = _line_documents(text)
    if document is None:
        if source.name.endswith(".json"):
            raise DataError(f"{source.name}: is not valid JSON; {JSON_FORM}")
        return source
    return text_source(_csv_text(document, source.name), source.name)


def _line_documents(text: str) -> Any:
    """The documents of single lines as a list; None if a line is not a document."""
    try:
        return [json.loads(line) for line in text.splitlines() if line.strip()]
    except (ValueError, RecursionError):
        return None


def _limit_length(lines: Iterator[str], name: str) -> Iterator[str]:
    size = 0
    for line in lines:
        size += len(line)
        if size > LONGEST:
            raise DataError(f"{name}: has more than {LONGEST >> 20} million characters; save it as CSV")
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
