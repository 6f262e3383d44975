"""A spectrum as averages over narrow bands, each distributed as chi-square over its degrees of freedom.

What is slow comes from the cosine transform of the record's means. Its functions are the principal components of any
mixture of white noise and a random walk (they are the eigenvectors of the differences' normal matrix), so there the
coefficients are independent, and nothing leaks from the large to the small, as it does in a periodogram whose record
ends elsewhere than it began; no window is needed, which would cost half of the information. A 1/f noise's coefficients
are nearly so, with variances that are known. What is faster comes from short stretches.

Source  Strang, SIAM Review 41 (1999): the transform; Whittle, Ark. Mat. 2 (1953): the likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import dct
from scipy.special import sici

from calibrations.noise_analysis.processes import LINEAR, Sampling, flicker, gauss_markov
from calibrations.table import Array

SINGLE = 16  # lowest coefficients, that stand for themselves
RATIO = 1.05  # of a band's ends


@dataclass(frozen=True)
class Bands:
    """Two-sided densities of b bands, all of one sampling, before a low-pass of a known corner (or none)."""

    frequency_hz: Array  # (b,)
    density: Array  # (b,) in unit^2/Hz
    freedom: Array  # (b,)
    sampling: Sampling
    number: Array  # (b,) number of the coefficient; 0: not of a cosine transform
    corner_hz: float

    def column(self, process: str, time_constant_s: float = 0.0) -> Array:
        """What is expected of a process, for a coefficient of 1, shape (b,).

        What a filter lets through of white noise is a Gauss-Markov process, and none of it folds back as white noise
        would; what is slow is so far below the corner that the filter's gain is enough.
        """
        f = self.frequency_hz
        if process == "quantisation-noise":
            return np.asarray(LINEAR[process].spectrum(f, self.sampling) + self._of_the_ends())
        if process == "flicker-noise":
            return np.asarray(flicker(f, self.sampling, self.corner_hz) * flickering(self.number))
        if process == "white-noise" and np.isfinite(self.corner_hz):
            filter_s = 1 / (2 * np.pi * self.corner_hz)
            return gauss_markov(f, self.sampling, filter_s) / (2 * filter_s)
        kept = 1 / (1 + (f / self.corner_hz) ** 2)
        if process not in LINEAR:
            return np.asarray(kept * gauss_markov(f, self.sampling, time_constant_s))
        return np.asarray(kept * LINEAR[process].spectrum(f, self.sampling))

    def _of_the_ends(self) -> Array:
        """What the first and the last error of quantisation add to every cosine coefficient."""
        half_turn = np.pi * self.frequency_hz * self.sampling.interval_s
        n = self.number / (2 * self.frequency_hz * self.sampling.interval_s)
        return (
            np.where(self.number > 0, 4 * np.cos(half_turn) ** 2 / np.maximum(n, 1.0), 0.0) / self.sampling.interval_s
        )


def flickering(number: Array) -> Array:
    """Variance of a cosine coefficient of 1/f noise over the spectrum at its frequency.

    From the generalised covariance -2 log(t): (2 / pi) (Si(pi k) - (1 - cos(pi k)) / (pi k)), 0.774 for the first.
    """
    a = np.pi * np.where(number > 0, number, 1.0)
    return np.where(number > 0, 2 / np.pi * (sici(a)[0] - (1 - np.cos(a)) / a), 1.0)


def slow_bands(means: Array, sampling: Sampling, corner_hz: float = np.inf) -> Bands:
    """Of a record's means, shape (n,), up to half the corner of the output's filter."""
    n = len(means)
    highest = min(n, 2 + int(corner_hz * n * sampling.interval_s) if np.isfinite(corner_hz) else n)
    power = dct(means, type=2, norm="ortho")[1:highest] ** 2 * sampling.interval_s
    edges = _edges(len(power))
    count = np.diff(edges).astype(float)
    number = (edges[1:] + edges[:-1] + 1) / 2
    density = np.add.reduceat(power, edges[:-1]) / count
    return Bands(number / (2 * n * sampling.interval_s), density, count, sampling, number, corner_hz)


def fast_bands(frequency_hz: Array, density: Array, freedom: float, rate_hz: float, corner_hz: float) -> Bands:
    """Of ordinates (f,) with so many degrees of freedom each, up to half the corner of the output's filter.

    Under a Hann window neighbours have a correlation of 4/9, and their neighbours 1/36.
    """
    chosen = frequency_hz <= corner_hz / 2
    edges = _edges(int(chosen.sum()))
    count = np.diff(edges).astype(float)
    alike = 1 + 2 * (np.maximum(count - 1, 0) * 4 / 9 + np.maximum(count - 2, 0) / 36) / np.maximum(count, 1)

    def mean(values: Array) -> Array:
        return np.add.reduceat(values[chosen], edges[:-1]) / count if len(count) else np.empty(0)

    none = np.zeros(len(count))
    return Bands(mean(frequency_hz), mean(density), freedom * count / alike, Sampling(rate_hz), none, corner_hz)


def _edges(n: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Where bands of n ordinates begin, and n."""
    edges = [*range(min(n, SINGLE) + 1)]
    while edges[-1] < n:
        edges.append(min(n, max(edges[-1] + 1, int(edges[-1] * RATIO))))
    return np.array(edges, dtype=np.int64)
