"""Cells of a text as numbers and times, and the lines that are damaged: counted, shown and skipped while they are few.

A log of hours has lines that were cut or garbled on a wire, and a header again after each restart of the logger. A
table whose lines are damaged as a rule was understood wrongly: it is refused with the first of them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import date, timedelta
from itertools import chain, islice
from typing import Literal

from calibrations.errors import DataError
from calibrations.table import Constant

_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:(?:,\d{3})+\.\d+|(?:\.\d{3})+,\d+)")  # 1,234.5 and 1.234,5
_TIME = re.compile(
    r"(?:(?P<date>\d{4}[-/]\d\d[-/]\d\d)[T ])?"
    r"(?P<hour>[01]?\d|2[0-3]):(?P<minute>[0-5]\d):(?P<second>[0-5]\d(?:[.,]\d+)?)(?P<zone>Z|[+-]\d\d(?::?\d\d)?)?"
)
EPOCH = date(1970, 1, 1)
_COMMA = re.compile(r",(?=\d+([eE]|$))")


def parse_number(cell: str) -> float:
    """The number in a cell, with decimal point or decimal comma. Raises ValueError."""
    if "_" in cell:
        raise ValueError(cell)  # float() would take 1_000
    if _THOUSANDS.fullmatch(cell):
        mark = "," if cell.rindex(",") < cell.rindex(".") else "."
        cell = cell.replace(mark, "")
    return float(_COMMA.sub(".", cell) if "," in cell else cell)


def parse_cell(cell: str) -> float:
    """The number in a cell, or its date or time of day in s: `2026-01-04T12:00:00.02Z`, `12:00:00,020`.

    A date counts from 1970 and has no time zone, or its own. Raises ValueError.
    """
    try:
        return parse_number(cell)
    except ValueError:
        if not (match := _TIME.fullmatch(cell)):
            raise
        hours, minutes, seconds = (float(match[name].replace(",", ".")) for name in ("hour", "minute", "second"))
        day = date.fromisoformat(match["date"].replace("/", "-")) - EPOCH if match["date"] else timedelta()
        return day.total_seconds() + 3600 * hours + 60 * minutes + seconds - _zone_s(match["zone"] or "")


def _zone_s(zone: str) -> float:
    """Offset of a time zone, such as `+02:00`, in s."""
    if zone in ("", "Z"):
        return 0.0
    return float(zone[0] + "1") * (3600 * int(zone[1:3]) + 60 * int(zone[-2:] if len(zone) > 3 else 0))


def is_number(cell: str) -> bool:
    """Whether a cell holds a finite number."""
    return isinstance(value := number_or_text(cell), float) and abs(value) != float("inf") and value == value


def number_or_text(cell: str) -> Constant:
    """The cell as a number, or else as text."""
    try:
        return parse_number(cell)
    except ValueError:
        return cell


# Damaged lines


MOST_SKIPPED = 0.01  # of the lines, unless a person asks for more
MOST_ASKED = 0.5  # of the lines in any case
SHOWN = 3
BEYOND = 10.0  # times the largest of the other values: a number that lost its exponent
BATCH = 1000  # lines
FEWEST_OF_LOG = 100  # lines: a shorter table may be typed by hand, its last line without an end

Policy = Literal["few", "skip", "refuse"]
SHARES: dict[Policy, float] = {"few": MOST_SKIPPED, "skip": MOST_ASKED, "refuse": 0.0}


@dataclass
class BadLines:
    """The damaged lines of a file. `share`: the most of its lines that are skipped; 0 refuses the first one."""

    name: str
    share: float
    good: int = 0
    bad: int = 0
    shown: list[str] = field(default_factory=list)
    first: str = ""  # the message about the first one

    def add(self, line: int, reason: str, message: str, lines: int = 1) -> None:
        """Count one more damaged line. Raises DataError with `message` if no lines may be skipped."""
        if not self.share:
            raise DataError(message)
        self.first = self.first or message
        self.bad += lines
        if len(self.shown) < SHOWN:
            self.shown.append(f"line {line} ({reason})")

    def end(self, report: Callable[[str], None]) -> None:
        """Report the skipped lines to `report` at the end of the file. Raises DataError if too many were skipped."""
        if not self.bad:
            return
        total = self.good + self.bad
        count_words = f"{self.bad} of {total} lines" if self.bad > 1 else f"1 of {total} lines"
        if self.bad > self.share * total:
            option = "" if self.share == MOST_ASKED else "; --bad-lines skip skips them"
            raise DataError(
                f"{self.first} ({count_words} are damaged, and at most {100 * self.share:g} % are skipped{option})"
            )
        rest_words = f" and {self.bad - len(self.shown)} more" if self.bad > len(self.shown) else ""
        verb = "are damaged and were" if self.bad > 1 else "is damaged and was"
        report(f"{self.name}: {count_words} {verb} skipped: {', '.join(self.shown)}{rest_words}.")


@dataclass
class Lines:
    """Lines of a text, and the last one that was read. A log that was cut has no line end there."""

    lines: Iterator[str]
    last: str = ""

    def __iter__(self) -> Iterator[str]:
        for line in self.lines:
            self.last = line
            yield line

    def in_batches(self) -> Iterator[str]:
        """The lines for a reader that needs `last` at the end alone: without work in Python for each line."""
        return chain.from_iterable(self._batches())

    def _batches(self) -> Iterator[list[str]]:
        while batch := list(islice(self.lines, BATCH)):
            self.last = batch[-1]
            yield batch

    def may_be_cut(self, cell: str, sample: Sequence[Sequence[str]], in_doubt: bool) -> bool:
        """Whether the last line has no end, and its last `cell` has lost digits, as other rows show.

        Integers of different lengths, and numbers of which some have an exponent, do not show it: then `in_doubt`.
        """
        if self.last.endswith("\n") or not is_number(cell):
            return False
        others = [row[-1] for row in sample[:-1] if is_number(row[-1])]
        if len(others) < FEWEST_OF_LOG:
            return False
        digits = _decimals if all(map(_decimals, others)) else _length
        least, most = min(map(digits, others)), max(map(digits, others))
        if any("e" in other.lower() for other in others):  # without its exponent a number is another one
            is_alone = all("e" in other.lower() for other in others) and "e" not in cell.lower()
            return in_doubt or is_alone or abs(parse_number(cell)) > BEYOND * max(abs(parse_number(o)) for o in others)
        if least == most or digits is _decimals:
            return digits(cell) < least - (least != most)
        return in_doubt and digits(cell) < most


def _decimals(cell: str) -> int:
    return len(cell.replace(",", ".").partition(".")[2])


def _length(cell: str) -> int:
    return len(cell.lstrip("+-"))
