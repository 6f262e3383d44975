"""Whether a channel is at its limits: where noise would have few samples, a clipped record has many."""

from __future__ import annotations

import numpy as np

from calibrations.errors import DataError
from calibrations.table import Array

CLIPPED = 0.002  # of all samples at exactly the highest or the lowest value
MORE = 10.0  # times as many as have the same value anyway


class Ends:
    """The highest and the lowest value so far, and how many samples have them."""

    def __init__(self) -> None:
        self._n = 0
        self._alike = 1.0  # share of samples that have one value
        self._ends: dict[str, tuple[float, int]] = {}

    def add(self, samples: Array) -> None:
        """The next samples, shape (n,)."""
        if not len(samples):
            return
        if not self._n:
            self._alike = 1 / len(np.unique(samples))
        self._n += len(samples)
        for name, value in (("highest", float(samples.max())), ("lowest", float(samples.min()))):
            before, count = self._ends.get(name, (value, 0))
            beyond = value > before if name == "highest" else value < before
            if beyond or value == before:
                count = int(np.count_nonzero(samples == value)) + (0 if beyond else count)
                self._ends[name] = value, count

    def check(self, source: str) -> None:
        """Raises DataError where the channel is at a limit, or does not change at all."""
        if len({value for value, _ in self._ends.values()}) == 1:
            raise DataError(
                f"{source}: every sample is the same; is the sensor connected, powered and not at its limit?"
            )
        for name, (value, count) in self._ends.items():
            if count > max(CLIPPED * self._n, MORE * self._alike * self._n, 3):
                raise DataError(
                    f"{source}: {count} of {self._n} samples are at the {name} value, {value:g}: the channel is "
                    "clipped; choose a wider range of the converter, or a part of the record within it"
                )
