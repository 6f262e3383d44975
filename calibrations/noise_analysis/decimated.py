"""A record of any length as means, 2^17 at most, of equally many samples: of twice as many when they are full."""

from __future__ import annotations

import numpy as np

from calibrations.table import Array

MOST = 1 << 17


class Means:
    """Means of the samples so far, in order."""

    def __init__(self) -> None:
        self.size = 1  # samples to a mean
        self._sums = np.empty(MOST)
        self._filled = 0
        self._rest = np.empty(0)  # samples that fill no mean yet
        self._offset: float | None = None  # taken off before sums, so that they keep their digits

    def add(self, samples: Array) -> None:
        """The next samples, shape (n,)."""
        samples = np.asarray(samples, dtype=np.float64)
        if self._offset is None and len(samples):
            self._offset = float(samples.mean())
        waiting = np.concatenate([self._rest, samples - (self._offset or 0.0)])
        while len(waiting) >= self.size:
            taken = min(len(waiting) // self.size, MOST - self._filled)
            sums = waiting[: taken * self.size].reshape(-1, self.size).sum(axis=1)
            self._sums[self._filled : self._filled + taken] = sums
            self._filled += taken
            waiting = waiting[taken * self.size :]
            if self._filled == MOST:
                self._halve()
        self._rest = waiting

    def values(self) -> Array:
        """The means less their mean, shape (n,)."""
        means = self._sums[: self._filled] / self.size
        return means - means.mean() if len(means) else means

    def _halve(self) -> None:
        self._sums[: MOST // 2] = self._sums[0::2] + self._sums[1::2]
        self._filled, self.size = MOST // 2, 2 * self.size
