"""The spectrum of what is too fast for means: periodograms of short stretches under a Hann window, averaged.

Stretches overlap by half; ordinates of neighbouring stretches then have a correlation of 1/36. They are summed by time,
in a few dozen parts of the record.

Source  Welch, IEEE Trans. Audio Electroacoust. 15 (1967).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrations.table import Array

LENGTH = 4096  # samples to a stretch
ALIKE = 1 + 2 / 36
WINDOW = np.sin(np.pi * (np.arange(LENGTH) + 0.5) / LENGTH) ** 2
MOST = 32  # parts, of equally many stretches: of twice as many when they are full


@dataclass(frozen=True, eq=False)
class Segments:
    """Periodograms summed over the stretches of each part, without 0 and Nyquist; (parts, ordinates) and (parts,)."""

    power: Array
    stretches: NDArray[np.int64]
    rate_hz: float

    @property
    def frequency_hz(self) -> Array:
        """Of the ordinates."""
        return np.arange(1, LENGTH // 2) * self.rate_hz / LENGTH

    @property
    def density(self) -> Array:
        """Two-sided, over all parts, unit^2/Hz."""
        scale = self.rate_hz * np.sum(WINDOW**2) * max(int(self.stretches.sum()), 1)
        return np.asarray(self.power.sum(axis=0) / scale)

    @property
    def freedom(self) -> float:
        """Degrees of freedom to each ordinate."""
        return 2 * max(int(self.stretches.sum()), 1) / ALIKE

    def part(self, first: int, end: int) -> Segments:
        """Some of the parts."""
        return Segments(self.power[first:end], self.stretches[first:end], self.rate_hz)


class Welch:
    """The sums of periodograms so far."""

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._rest = np.empty(0)
        self._power = np.zeros((MOST, LENGTH // 2 - 1))
        self._stretches = np.zeros(MOST, dtype=np.int64)
        self._part, self._full = 0, 1  # the part that is filled now, and how many stretches fill one

    def add(self, samples: Array) -> None:
        """The next samples, shape (n,)."""
        waiting = np.concatenate([self._rest, samples])
        starts = range(0, len(waiting) - LENGTH + 1, LENGTH // 2)
        for start in starts:
            if self._stretches[self._part] == self._full:
                self._begin_another()
            stretch = waiting[start : start + LENGTH]
            self._power[self._part] += np.abs(np.fft.rfft((stretch - stretch.mean()) * WINDOW))[1:-1] ** 2
            self._stretches[self._part] += 1
        self._rest = waiting[len(starts) * LENGTH // 2 :]

    def segments(self) -> Segments:
        """By time."""
        count = self._part + 1
        return Segments(self._power[:count].copy(), self._stretches[:count].copy(), self._rate_hz)

    def _begin_another(self) -> None:
        self._part += 1
        if self._part < MOST:
            return
        for each in (self._power, self._stretches):
            each[: MOST // 2] = each[0::2] + each[1::2]
            each[MOST // 2 :] = 0
        self._part, self._full = MOST // 2, 2 * self._full
