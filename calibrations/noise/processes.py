"""The processes that noise is made of: spectrum of each for a coefficient of 1, and its Allan variance at long times.

    process             spectrum S(f), two-sided    Allan variance        coefficient, unit of the values U
    white-noise         N^2                         N^2 / tau             U/sqrt(Hz): angle or velocity random walk
    flicker-noise       B^2 / (2 pi f)              (2 ln 2 / pi) B^2     U: bias instability
    rate-random-walk    K^2 / (2 pi f)^2            K^2 tau / 3           U/sqrt(s)
    quantisation-noise  (2 pi f)^2 Q^2 dt           3 Q^2 / tau^2         U s: of the values' sum, as of an angle
    gauss-markov-noise  2 s^2 T / (1 + (2 pi f T)^2)                      U: standard deviation; T, s
    sinusoidal-noise    a line                      a^2 sin^4/(..)^2      U: amplitude; frequency, Hz

Spectra are those of means over `size` samples of the sampled process, folded at the means' own Nyquist frequency.

Source  IEEE 952, annex C; IEEE 1293; Book 17.3, (17.4)-(17.5).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from calibrations.table import Array

FOLDS = 32  # of the spectrum above the means' Nyquist frequency that are added, each way


@dataclass(frozen=True)
class Sampling:
    """Means over `size` samples, taken `rate_hz` a second."""

    rate_hz: float
    size: int = 1

    @property
    def interval_s(self) -> float:
        """Between means."""
        return self.size / self.rate_hz


def white(f: Array, _: Sampling) -> Array:
    """1 at every frequency."""
    return np.ones_like(f)


def flicker(f: Array, by: Sampling, corner_hz: float = np.inf) -> Array:
    """Fractionally differenced noise of order 1/2 (Kasdin, Proc. IEEE 83, 1995), which is 1 / (2 pi f) but near the
    sampling frequency; behind a first-order low-pass where it has a corner; folded."""
    folds = min(FOLDS, by.size // 2)
    step, total = 1 / by.rate_hz, np.zeros_like(f)
    for fold in range(-folds, folds + 1 - (by.size % 2 == 0 and folds < FOLDS)):
        at_hz = f + fold / by.interval_s
        sine = np.abs(np.sin(np.pi * at_hz * step))
        total += _kept(f, sine, by) * step / (2 * sine) / (1 + (at_hz / corner_hz) ** 2)
    return total


def _kept(f: Array, sine: Array, by: Sampling) -> Array:
    """Power that a mean keeps of a frequency; `sine` is that of half its phase from sample to sample."""
    return np.asarray((np.sin(np.pi * f * by.interval_s) / (by.size * sine)) ** 2)


def random_walk(f: Array, by: Sampling) -> Array:
    """Of steps at each sample: what means differ by has covariances at lags 0 and 1 only."""
    s = by.size
    phase = 2 * np.pi * f * by.interval_s
    increments = (2 * s**2 + 1) / (3 * s) + np.cos(phase) * (s**2 - 1) / (3 * s)
    return np.asarray(increments * by.interval_s / by.rate_hz / (4 * np.sin(phase / 2) ** 2))


def quantisation(f: Array, by: Sampling) -> Array:
    """Of the values' sum, rounded at each sample; of a mean only the ends count."""
    return np.asarray(4 * np.sin(np.pi * f * by.interval_s) ** 2 / by.interval_s)


def gauss_markov(f: Array, by: Sampling, time_constant_s: float) -> Array:
    """First-order, of unit variance."""
    a, s = 1 / (by.rate_hz * time_constant_s), by.size
    phi, step = np.exp(-a), -np.expm1(-a)
    whole = -np.expm1(-a * s)
    variance = (1 + phi) / (step * s) - 2 * phi * whole / (s * step) ** 2
    turn = np.exp(2j * np.pi * f * by.interval_s)
    lagged = 2 * phi * (whole / (s * step)) ** 2 * (turn / (1 - (1 - whole) * turn)).real
    return np.asarray(by.interval_s * (variance + lagged))


@dataclass(frozen=True)
class Process:
    """Spectrum for a coefficient of 1, and what to multiply a value's unit with."""

    spectrum: Callable[[Array, Sampling], Array]
    per: str


LINEAR: Mapping[str, Process] = MappingProxyType(
    {
        "white-noise": Process(white, "/sqrt(Hz)"),
        "flicker-noise": Process(flicker, ""),
        "rate-random-walk": Process(random_walk, "/sqrt(s)"),
        "quantisation-noise": Process(quantisation, "*s"),
    }
)
GAUSS_MARKOV, SINUSOIDAL = "gauss-markov-noise", "sinusoidal-noise"
