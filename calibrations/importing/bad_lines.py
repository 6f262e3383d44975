"""Damaged lines of a text log: counted, shown and skipped as long as they are few.

A log of hours has lines that were cut or garbled on a wire, and a header again after each restart of the logger. A
table whose lines are damaged as a rule was understood wrongly: it is refused with the first of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from calibrations.errors import DataError

MOST_SKIPPED = 0.01  # of the lines, unless a person asks for more
MOST_ASKED = 0.5  # of the lines in any case
SHOWN = 3

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
