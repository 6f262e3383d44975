"""Lines of text of a digital sensor, and the samples in them.

    csv        0.0123,-0.004,1.002              column numbers, from 1; separators , ; tab and space
    named      ax:0.0123 ay:-0.004 az:1.002     column names; `=` in place of `:` as well
    teleplot   >ax:1627551892437:0.0123         one value a line: a sample is complete when each column has come
    nmea       $PIMU,0.0123,-0.004,1.002*5A     column numbers after the first word; XOR checksum from $ to *

Source  README of Teleplot: `>name:value`, `>name:ms:value`, each with an optional unit after `§`.
        NMEA 0183: checksum.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import reduce
from operator import xor
from typing import NoReturn

TIME = "time"  # name of the column of the sensor's own time
PAIR = re.compile(r"([A-Za-z_][\w.]*)\s*[:=]\s*([-+]?[\d.][\d.eE+-]*)")
MOST_SHOWN = 10_000  # lines that an assembly keeps for a proposal
Column = int | str


def checksum(text: str) -> int:
    """XOR of the bytes of `text`, the part between $ and * of an NMEA line."""
    return reduce(xor, text.encode("latin-1"), 0)


def fields(line: str, style: str) -> dict[Column, float]:
    """The numbers of a line by column: its number from 1, or its name. Raises ValueError for a damaged line."""
    if style == "named":
        return {name: float(value) for name, value in PAIR.findall(line)} or _refuse_line(line)
    if style == "teleplot":
        name, _, value_text = line.removeprefix(">").partition(":")
        value = value_text.partition("|")[0].partition("§")[0].rpartition(":")[2]
        return {name: float(value)} if line.startswith(">") and name else _refuse_line(line)
    if style == "nmea":
        line = _check_line(line).partition(",")[2]
    return _numbers(_cells(line)) or _refuse_line(line)


def _cells(line: str) -> list[str]:
    return re.split(r"[,;\t]\s*|\s+", line.strip())


def _numbers(cells: list[str]) -> dict[Column, float]:
    return {k: number for k, text in enumerate(cells, 1) if (number := _number(text)) is not None}


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _check_line(line: str) -> str:
    text, star, checksum_text = line.removeprefix("$").partition("*")
    if not (line.startswith("$") and star and int(checksum_text, 16) == checksum(text)):
        raise ValueError(f"{line!r} has a wrong checksum")
    return text


def _refuse_line(line: str) -> NoReturn:
    raise ValueError(f"{line!r} has no number")


@dataclass
class Assembly:
    """Converts bytes to samples as they arrive. The first line may be incomplete and is dropped without being counted.

    A line that lost its end continues with the next one. Without a checksum (csv), a line is damaged if it has not as
    many columns as the samples before it, unless the next line has as many.

    `damaged`: lines that could not be read. `unread`: the first of them. `last_columns`: of the last good line.
    `shown`: the first whole lines.
    """

    style: str
    columns: Mapping[str, Column]
    damaged: int = 0
    good: int = 0
    unread: str = ""
    last_columns: tuple[Column, ...] = ()
    shown: list[str] = field(default_factory=list)
    remainder: bytes = b""
    _cut: bool = True
    _width: int = 0  # columns of the samples so far
    _other_width: int = 0  # of the line before, if it has another number of columns
    _pending: dict[Column, float] = field(default_factory=dict)

    def take(self, data: bytes) -> list[dict[str, float]]:
        """The samples that `data` completes, each by the names of `columns`."""
        *lines, self.remainder = (self.remainder + data).split(b"\n")
        if self._cut and lines:
            lines, self._cut = lines[1:], False
        return [sample for line in lines if (sample := self._read(line)) is not None]

    def _read(self, raw: bytes) -> dict[str, float] | None:
        line = raw.decode("utf-8", "replace").strip()
        if not line or line.startswith("#"):
            return None
        if len(self.shown) < MOST_SHOWN:
            self.shown.append(line)
        cells = _cells(line) if self.style == "csv" else []
        try:
            values = _numbers(cells) if cells else fields(line, self.style)
        except ValueError:
            self._count_damaged(line)
            return None
        self.last_columns = (
            tuple(dict.fromkeys([*self.last_columns, *values])) if self.style == "teleplot" else tuple(values)
        )
        columns = set(self.columns.values())
        if self.style == "teleplot":
            if not columns & values.keys():
                return None
            if values.keys() & self._pending.keys():  # the rest of the earlier sample is lost
                self._pending.clear()
                self.damaged += 1
            values = self._pending = self._pending | values
            if not columns <= values.keys():
                return None
            self._pending = {}
        is_whole = columns <= values.keys() and all(math.isfinite(values[column]) for column in columns)
        if not is_whole or not self._keeps_width(len(cells)):
            self._count_damaged(line)
            return None
        self.good += 1
        return {name: values[column] for name, column in self.columns.items()}

    def _keeps_width(self, width: int) -> bool:
        """Whether a line has as many columns as the samples before it, or as the line before it."""
        if width not in (self._width, self._other_width) and self._width:
            self._other_width = width
            return False
        self._width, self._other_width = width, 0
        return True

    def _count_damaged(self, line: str) -> None:
        self.damaged += 1
        self.unread = self.unread or line[:60]
