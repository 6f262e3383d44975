"""The spectrum of what is too fast for means: periodograms of short stretches under a Hann window, averaged.

Stretches overlap by half; ordinates of neighbouring stretches then have a correlation of 1/36.

Source  Welch, IEEE Trans. Audio Electroacoust. 15 (1967).
"""

from __future__ import annotations

import numpy as np

from calibrations.table import Array

LENGTH = 4096  # samples to a stretch
ALIKE = 1 + 2 / 36
WINDOW = np.sin(np.pi * (np.arange(LENGTH) + 0.5) / LENGTH) ** 2


class Welch:
    """The sum of periodograms so far."""

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._rest = np.empty(0)
        self._power = np.zeros(LENGTH // 2 + 1)
        self._stretches = 0

    def add(self, samples: Array) -> None:
        """The next samples, shape (n,)."""
        waiting = np.concatenate([self._rest, samples])
        starts = range(0, len(waiting) - LENGTH + 1, LENGTH // 2)
        for start in starts:
            part = waiting[start : start + LENGTH]
            self._power += np.abs(np.fft.rfft((part - part.mean()) * WINDOW)) ** 2
        self._stretches += len(starts)
        self._rest = waiting[len(starts) * LENGTH // 2 :]

    def ordinates(self) -> tuple[Array, Array, float]:
        """(frequencies, Hz; two-sided densities, unit^2/Hz; degrees of freedom to each), without 0 and Nyquist."""
        frequency_hz = np.arange(1, LENGTH // 2) * self._rate_hz / LENGTH
        scale = self._rate_hz * np.sum(WINDOW**2) * max(self._stretches, 1)
        return frequency_hz, self._power[1:-1] / scale, 2 * max(self._stretches, 1) / ALIKE
