"""A table of motion as records: stretches of evenly spaced samples at one attitude, without a gap."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from calibrations.errors import DataError, TooFewRows
from calibrations.table import Array, Table

GAP = 1.5  # times the usual step of time
UNEVEN = 0.75  # of a step: rounded times are less, a lost sample is more
SHORTEST_S = 2.0
SAME = ("alpha_deg", "beta_deg", "mount_deg", "flip", "record")  # throughout a record


@dataclass(frozen=True)
class Record:
    """Rows `first` to `end` (not included), at `rate_hz`."""

    first: int
    end: int
    rate_hz: float

    @property
    def rows(self) -> slice:
        """The rows."""
        return slice(self.first, self.end)

    def times_s(self, t: Array) -> Array:
        """The rows' times, evenly spaced: those of the table `t` may be rounded."""
        return np.asarray(t[self.first] + np.arange(self.end - self.first) / self.rate_hz)


@lru_cache(maxsize=8)
def records(table: Table) -> tuple[Record, ...]:
    """The records of at least 2 s, rows in order of time.

    Raises DataError for samples that are not evenly spaced, TooFewRows where no record is long enough.
    """
    t = table.column("t_s")
    if np.any(np.diff(t) < 0):
        row = int(np.argmax(np.diff(t) < 0)) + 2
        raise DataError(f'{table.source}: row {row}, column "t_s" falls; samples stand in order of time')
    if table.n < 2 or not t[-1] > t[0]:
        raise TooFewRows(f"{table.source}: {table.n} samples at one time are no record of a motion")
    step = float(np.median(np.diff(t))) or float(t[-1] - t[0]) / (table.n - 1)
    cut = np.diff(t) > GAP * step
    for name in SAME:
        cut |= np.diff(table.optional(name, 0.0)) != 0
    edges = np.concatenate([[0], np.flatnonzero(cut) + 1, [table.n]])
    long = [(int(a), int(b)) for a, b in pairwise(edges) if (b - a) * step >= SHORTEST_S - step / 2]
    if not long:
        raise TooFewRows(
            f"{table.source}: no record lasts {SHORTEST_S:g} s at one attitude without a gap; record the motion longer"
        )
    return tuple(_checked(table, t, a, b) for a, b in long)


def _checked(table: Table, t: Array, first: int, end: int) -> Record:
    part = t[first:end]
    rate_hz = (len(part) - 1) / float(part[-1] - part[0])
    late = np.abs(part - part[0] - np.arange(len(part)) / rate_hz)
    if late.max() > UNEVEN / rate_hz:
        row = first + int(np.argmax(late)) + 1
        raise DataError(
            f'{table.source}: row {row}, column "t_s" is {late.max() * rate_hz:.2g} of a step off; a motion is sampled '
            "evenly, at the converter's own pace"
        )
    return Record(first, end, rate_hz)
