"""Texts that are no table: lines of named values become one, and known other formats are refused with a remedy."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from calibrations.errors import DataError
from calibrations.files import Source, text_source

NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|nan"
PAIR = rf"(?P<name>[A-Za-z_][\w.]*)\s*[:=]\s*(?P<value>{NUMBER})(?=[,;\s]|$)"
NAMED = re.compile(PAIR)
_ANOTHER = re.sub(r"\?P<\w+>", "", PAIR)
NAMED_LINE = re.compile(rf"\s*{_ANOTHER}(?:[,;\s]+{_ANOTHER})+\s*")
LONGEST_LOG = 1 << 26  # characters: the text is held in memory
REFUSED: Mapping[str, str] = {  # pattern of the first line -> format of the file, and what to do
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


def as_table(first: str, source: Source) -> Source:
    """`source`, or its lines of named values, such as `ax:0.1,ay:0.2`, as a table. `first`: its first line.

    Raises DataError for a known format that is no table.
    """
    for form, reason in REFUSED.items():
        if re.match(form, first, re.IGNORECASE):
            raise DataError(f"{source.name}: {reason}")
    if not NAMED_LINE.fullmatch(first):
        return source
    names = [match["name"] for match in NAMED.finditer(first)]
    with source.lines(marked=True) as lines:
        rows = list(_rows(lines, names, source.name))
    return text_source("".join([",".join(names) + "\n", *rows]), source.name)


def _rows(lines: Iterator[str], names: list[str], name: str) -> Iterator[str]:
    """The values of each line, with its line end; a damaged line as it is, which the table then counts."""
    size = 0
    for line in filter(str.strip, lines):
        size += len(line)
        if size > LONGEST_LOG:
            raise DataError(f"{name}: has more than {LONGEST_LOG >> 20} million characters; save it as CSV")
        found = {match["name"]: match["value"] for match in NAMED.finditer(line)}
        row = ",".join(found.values()) if list(found) == names else line.strip()
        yield row + "\n" if line.endswith("\n") else row
