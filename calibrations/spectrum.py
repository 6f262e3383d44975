"""Spectra of noise processes, and the spectrum of a record as averages over narrow bands.

    process             spectrum S(f), two-sided    Allan variance        coefficient, unit of the values U
    white-noise         N^2                         N^2 / tau             U/sqrt(Hz): angle or velocity random walk
    flicker-noise       B^2 / (2 pi f)              (2 ln 2 / pi) B^2     U: bias instability
    rate-random-walk    K^2 / (2 pi f)^2            K^2 tau / 3           U/sqrt(s)
    quantisation-noise  (2 pi f)^2 Q^2 dt           3 Q^2 / tau^2         U s: of the values' sum, as of an angle
    gauss-markov-noise  2 s^2 T / (1 + (2 pi f T)^2)                      U: standard deviation; T, s
    sinusoidal-noise    a line                      a^2 sin^4/(..)^2      U: amplitude; frequency, Hz

These spectra are those of means over `size` samples of the sampled process, folded at the means' Nyquist frequency.

The density of each band of a record is distributed as chi-square over its degrees of freedom. Slow bands come from the
cosine transform of the means of the record, of which there are 2^17 at most. The functions of the transform are the
principal components of any mixture of white noise and a random walk, so that its coefficients are independent, and
there is no leakage as in a periodogram; a window, which would cost half of the information, is not needed. The
coefficients of 1/f noise are nearly independent, with known variances.

Fast bands come from periodograms of short stretches under a Hann window, averaged in a few dozen parts of the record.
Stretches overlap by half; ordinates of neighbouring stretches then have a correlation of 1/36.

Source  IEEE 952, annex C; IEEE 1293; Book 17.3, (17.4)-(17.5): processes. Strang, SIAM Review 41 (1999): the transform;
        Whittle, Ark. Mat. 2 (1953): the likelihood; Welch, IEEE Trans. Audio Electroacoust. 15 (1967).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from types import MappingProxyType

import numpy as np
import scipy  # its modules load slowly: they are imported at their first use, and a list of effects needs none
from numpy.typing import NDArray

from calibrations.table import Array

FOLDS = 32  # of the spectrum above the means' Nyquist frequency that are added, each way


@dataclass(frozen=True)
class Sampling:
    """Means over `size` samples, taken `rate_hz` a second."""

    rate_hz: float
    size: int = 1

    @property
    def interval_s(self) -> float:
        """Time between two means, s."""
        return self.size / self.rate_hz


def white(f: Array, _: Sampling) -> Array:
    """The spectrum of white noise: 1 at every frequency."""
    return np.ones_like(f)


def flicker(f: Array, by: Sampling, corner_hz: float = np.inf) -> Array:
    """The folded spectrum of 1/f noise, behind a first-order low-pass if it has a corner.

    It is that of fractionally differenced noise of order 1/2 (Kasdin, Proc. IEEE 83, 1995): 1 / (2 pi f), except near
    the sampling frequency.
    """
    folds = min(FOLDS, by.size // 2)
    step, total = 1 / by.rate_hz, np.zeros_like(f)
    for fold in range(-folds, folds + 1 - (by.size % 2 == 0 and folds < FOLDS)):
        at_hz = f + fold / by.interval_s
        sine = np.abs(np.sin(np.pi * at_hz * step))
        total += _power_gain(f, sine, by) * step / (2 * sine) / (1 + (at_hz / corner_hz) ** 2)
    return total


def _power_gain(f: Array, sine: Array, by: Sampling) -> Array:
    """Power that a mean keeps of a frequency; `sine` is that of half its phase from sample to sample."""
    return np.asarray((np.sin(np.pi * f * by.interval_s) / (by.size * sine)) ** 2)


def random_walk(f: Array, by: Sampling) -> Array:
    """The spectrum of a random walk with a step at each sample.

    The difference of two successive means has a covariance with itself and with its neighbours only.
    """
    s = by.size
    phase = 2 * np.pi * f * by.interval_s
    increments = (2 * s**2 + 1) / (3 * s) + np.cos(phase) * (s**2 - 1) / (3 * s)
    return np.asarray(increments * by.interval_s / by.rate_hz / (4 * np.sin(phase / 2) ** 2))


def quantisation(f: Array, by: Sampling) -> Array:
    """The spectrum of the rounding of the values' sum. In a mean only the errors of its first and last sum remain."""
    return np.asarray(4 * np.sin(np.pi * f * by.interval_s) ** 2 / by.interval_s)


def gauss_markov(f: Array, by: Sampling, time_constant_s: float) -> Array:
    """The spectrum of a first-order Gauss-Markov process of unit variance."""
    a, s = 1 / (by.rate_hz * time_constant_s), by.size
    phi, step = np.exp(-a), -np.expm1(-a)
    decay = -np.expm1(-a * s)
    variance = (1 + phi) / (step * s) - 2 * phi * decay / (s * step) ** 2
    turn = np.exp(2j * np.pi * f * by.interval_s)
    lagged = 2 * phi * (decay / (s * step)) ** 2 * (turn / (1 - (1 - decay) * turn)).real
    return np.asarray(by.interval_s * (variance + lagged))


# Spectra of processes for a coefficient of 1.
LINEAR: Mapping[str, Callable[[Array, Sampling], Array]] = MappingProxyType(
    {
        "white-noise": white,
        "flicker-noise": flicker,
        "rate-random-walk": random_walk,
        "quantisation-noise": quantisation,
    }
)
GAUSS_MARKOV = "gauss-markov-noise"


SINGLE = 16  # lowest coefficients, that stand for themselves
RATIO = 1.05  # of a band's ends
MOST_COLUMNS = 128  # that are kept: those of a grid of shapes are computed before those between


@dataclass(frozen=True)
class Bands:
    """Two-sided densities of b bands, all of one sampling, before a low-pass of a known corner (or none)."""

    frequency_hz: Array  # (b,)
    density: Array  # (b,) in unit^2/Hz
    freedom: Array  # (b,)
    sampling: Sampling
    number: Array  # (b,) number of the coefficient; 0: not of a cosine transform
    corner_hz: float
    columns: dict[tuple[str, float], Array] = field(default_factory=dict, repr=False)  # those computed so far

    def column(self, process: str, time_constant_s: float = 0.0) -> Array:
        """The expected density of a process, for a coefficient of 1, shape (b,).

        What a filter lets through of white noise is a Gauss-Markov process, and none of it folds back as white noise
        would; what is slow is so far below the corner that the filter's gain is enough.
        """
        key = process, time_constant_s
        if key not in self.columns:
            column = self._column(process, time_constant_s)
            if len(self.columns) >= MOST_COLUMNS:
                return column
            self.columns[key] = column
        return self.columns[key]

    def _column(self, process: str, time_constant_s: float = 0.0) -> Array:
        f = self.frequency_hz
        if process == "quantisation-noise":
            return np.asarray(LINEAR[process](f, self.sampling) + self._end_contribution())
        if process == "flicker-noise":
            return np.asarray(flicker(f, self.sampling, self.corner_hz) * flickering(self.number))
        if process == "white-noise" and np.isfinite(self.corner_hz):
            filter_s = 1 / (2 * np.pi * self.corner_hz)
            return gauss_markov(f, self.sampling, filter_s) / (2 * filter_s)
        passed = 1 / (1 + (f / self.corner_hz) ** 2)
        if process not in LINEAR:
            return np.asarray(passed * gauss_markov(f, self.sampling, time_constant_s))
        return np.asarray(passed * LINEAR[process](f, self.sampling))

    def _end_contribution(self) -> Array:
        """The contribution of the first and the last error of quantisation to every cosine coefficient."""
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
    return np.where(number > 0, 2 / np.pi * (scipy.special.sici(a)[0] - (1 - np.cos(a)) / a), 1.0)


def slow_bands(means: Array, sampling: Sampling, corner_hz: float = np.inf) -> Bands:
    """The bands of a record's means (n,), up to half the corner of the output's filter."""
    n = len(means)
    highest = min(n, 2 + int(corner_hz * n * sampling.interval_s) if np.isfinite(corner_hz) else n)
    power = scipy.fft.dct(means, type=2, norm="ortho")[1:highest] ** 2 * sampling.interval_s
    grid = _slow_grid(n, highest, sampling, corner_hz)
    return replace(grid, density=np.add.reduceat(power, _edges(highest - 1)[:-1]) / grid.freedom)


@lru_cache(maxsize=8)
def _slow_grid(n: int, highest: int, sampling: Sampling, corner_hz: float) -> Bands:
    """Slow bands without power: records of one length have their columns in common."""
    edges = _edges(highest - 1)
    count = np.diff(edges).astype(float)
    number = (edges[1:] + edges[:-1] + 1) / 2
    return Bands(number / (2 * n * sampling.interval_s), np.zeros(len(count)), count, sampling, number, corner_hz)


def fast_bands(frequency_hz: Array, density: Array, freedom: float, rate_hz: float, corner_hz: float) -> Bands:
    """The bands of ordinates (f,) with their degrees of freedom, up to half the corner of the output's filter.

    Under a Hann window neighbours have a correlation of 4/9, and their neighbours 1/36.
    """
    in_band = frequency_hz <= corner_hz / 2
    edges = _edges(int(in_band.sum()))
    count = np.diff(edges).astype(float)
    alike = 1 + 2 * (np.maximum(count - 1, 0) * 4 / 9 + np.maximum(count - 2, 0) / 36) / np.maximum(count, 1)

    def mean(values: Array) -> Array:
        return np.add.reduceat(values[in_band], edges[:-1]) / count if len(count) else np.empty(0)

    none = np.zeros(len(count))
    return Bands(mean(frequency_hz), mean(density), freedom * count / alike, Sampling(rate_hz), none, corner_hz)


@lru_cache(maxsize=8)
def _edges(n: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """The first ordinate of each band of n ordinates, and n."""
    edges = [*range(min(n, SINGLE) + 1)]
    while edges[-1] < n:
        edges.append(min(n, max(edges[-1] + 1, int(edges[-1] * RATIO))))
    return np.array(edges, dtype=np.int64)


LENGTH = 4096  # samples to a stretch
ALIKE = 1 + 2 / 36
WINDOW = np.sin(np.pi * (np.arange(LENGTH) + 0.5) / LENGTH) ** 2
MOST_PARTS = 32  # parts, of equally many stretches: of twice as many when they are full


@dataclass(frozen=True, eq=False)
class Segments:
    """Periodograms summed over the stretches of each part, without 0 and Nyquist; (parts, ordinates) and (parts,)."""

    power: Array
    stretches: NDArray[np.int64]
    rate_hz: float

    @property
    def frequency_hz(self) -> Array:
        """The frequencies of the ordinates."""
        return np.arange(1, LENGTH // 2) * self.rate_hz / LENGTH

    @property
    def density(self) -> Array:
        """The two-sided density over all parts, unit^2/Hz."""
        scale = self.rate_hz * np.sum(WINDOW**2) * max(int(self.stretches.sum()), 1)
        return np.asarray(self.power.sum(axis=0) / scale)

    @property
    def freedom(self) -> float:
        """Degrees of freedom of each ordinate."""
        return 2 * max(int(self.stretches.sum()), 1) / ALIKE

    def part(self, first: int, end: int) -> Segments:
        """The segments of the parts from `first` to `end`."""
        return Segments(self.power[first:end], self.stretches[first:end], self.rate_hz)


class Welch:
    """The sums of periodograms so far."""

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._remainder = np.empty(0)
        self._power = np.zeros((MOST_PARTS, LENGTH // 2 - 1))
        self._stretches = np.zeros(MOST_PARTS, dtype=np.int64)
        self._part, self._full = 0, 1  # the part that is filled now, and how many stretches fill one

    def add(self, samples: Array) -> None:
        """The next samples, shape (n,)."""
        waiting = np.concatenate([self._remainder, samples])
        starts = range(0, len(waiting) - LENGTH + 1, LENGTH // 2)
        for start in starts:
            if self._stretches[self._part] == self._full:
                self._begin_another()
            stretch = waiting[start : start + LENGTH]
            self._power[self._part] += np.abs(np.fft.rfft((stretch - stretch.mean()) * WINDOW))[1:-1] ** 2
            self._stretches[self._part] += 1
        self._remainder = waiting[len(starts) * LENGTH // 2 :]

    def segments(self) -> Segments:
        """The segments of the samples so far, in order of time."""
        count = self._part + 1
        return Segments(self._power[:count].copy(), self._stretches[:count].copy(), self._rate_hz)

    def _begin_another(self) -> None:
        self._part += 1
        if self._part < MOST_PARTS:
            return
        for sums in (self._power, self._stretches):
            sums[: MOST_PARTS // 2] = sums[0::2] + sums[1::2]
            sums[MOST_PARTS // 2 :] = 0
        self._part, self._full = MOST_PARTS // 2, 2 * self._full


MOST_MEANS = 1 << 17


class Means:
    """Means of the samples so far, in order."""

    def __init__(self) -> None:
        self.size = 1  # samples to a mean
        self._sums = np.empty(MOST_MEANS)
        self._filled = 0
        self._remainder = np.empty(0)  # samples that fill no mean yet
        self._offset: float | None = None  # subtracted before sums, so that they keep their digits

    def add(self, samples: Array) -> None:
        """The next samples, shape (n,)."""
        samples = np.asarray(samples, dtype=np.float64)
        if self._offset is None and len(samples):
            self._offset = float(samples.mean())
        waiting = np.concatenate([self._remainder, samples - (self._offset or 0.0)])
        while len(waiting) >= self.size:
            count = min(len(waiting) // self.size, MOST_MEANS - self._filled)
            sums = waiting[: count * self.size].reshape(-1, self.size).sum(axis=1)
            self._sums[self._filled : self._filled + count] = sums
            self._filled += count
            waiting = waiting[count * self.size :]
            if self._filled == MOST_MEANS:
                self._halve()
        self._remainder = waiting

    def values(self) -> Array:
        """The means without their own mean, shape (n,)."""
        means = self._sums[: self._filled] / self.size
        return means - means.mean() if len(means) else means

    def _halve(self) -> None:
        self._sums[: MOST_MEANS // 2] = self._sums[0::2] + self._sums[1::2]
        self._filled, self.size = MOST_MEANS // 2, 2 * self.size
