"""A stretch of samples that are all the same: a converter that hangs, a link that repeats its last packet.

How long runs of equal samples are by chance is told by all the others: were they geometric, the longest of R runs would
be near their mean length times log R. A slow sensor under coarse steps has long ones everywhere, and none stands out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.table import Array

SHORTEST = 32  # samples
LONGER = 4.0  # times as long as the longest by chance


@dataclass(frozen=True)
class Run:
    """Equal samples: the number of the first, from 0, and how many."""

    start: int
    length: int


class Stuck:
    """The runs so far; blocks are added in order, `found` is asked at the end."""

    def __init__(self) -> None:
        self._n, self._runs = 0, 0  # samples, and runs that have ended
        self._longest, self._present = Run(0, 0), Run(0, 0)
        self._last = np.nan

    def add(self, samples: Array) -> None:
        """The next samples, shape (n,)."""
        if not len(samples):
            return
        begins = np.flatnonzero(np.diff(samples, prepend=self._last) != 0)
        if len(begins):
            self._end(int(begins[0]))
            lengths = np.diff(begins)
            if len(lengths):
                best = int(np.argmax(lengths))
                self._keep(Run(self._n + int(begins[best]), int(lengths[best])))
            self._runs += len(lengths) + (self._n > 0)
            self._present = Run(self._n + int(begins[-1]), 0)
        self._present = Run(self._present.start, self._n + len(samples) - self._present.start)
        self._n, self._last = self._n + len(samples), float(samples[-1])

    def found(self) -> Run | None:
        """The longest run, where chance makes none like it."""
        longest = max(self._longest, self._present, key=lambda run: run.length)
        others = max(1, self._runs)
        by_chance = (self._n - longest.length) / others * (1 + np.log(others))
        return longest if longest.length > max(SHORTEST, LONGER * by_chance) else None

    def _end(self, more: int) -> None:
        """The present run ends after `more` samples."""
        self._keep(Run(self._present.start, self._n + more - self._present.start))

    def _keep(self, run: Run) -> None:
        if run.length > self._longest.length:
            self._longest = run
