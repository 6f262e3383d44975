"""Noise processes made without the analysis: each by its own recursion, from a seeded generator."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Random = np.random.Generator
PAST = 8


def random_walk(random: Random, n: int) -> Array:
    """Steps of unit variance."""
    return np.cumsum(random.standard_normal(n))


def flicker(random: Random, n: int, past: int = PAST) -> Array:
    """1 / (2 pi f): white noise integrated by half, the last of `past` lengths (Kasdin, Proc. IEEE 83, 1995)."""
    k = np.arange(1, past * n)
    response = np.concatenate([[1.0], np.cumprod((k - 0.5) / k)])
    white = np.fft.rfft(random.standard_normal(past * n), 2 * past * n)
    return np.fft.irfft(white * np.fft.rfft(response, 2 * past * n), 2 * past * n)[(past - 1) * n : past * n]


def quantisation(random: Random, n: int) -> Array:
    """Differences of errors of unit variance: a sum over time that is read coarsely."""
    return np.diff(random.standard_normal(n + 1))


def gauss_markov(random: Random, n: int, time_constant: float) -> Array:
    """Of unit variance, by the exact recursion of an Ornstein-Uhlenbeck process from its stationary state."""
    kept = math.exp(-1 / time_constant)
    steps = random.standard_normal(n) * math.sqrt(1 - kept**2)
    value, out = random.standard_normal(), np.empty(n)
    for i, step in enumerate(steps):
        value = kept * value + step
        out[i] = value
    return out


def sinusoid(n: int, frequency: float, phase: float = 1.0) -> Array:
    """Of unit amplitude, cycles per sample."""
    return np.sin(2 * np.pi * frequency * np.arange(n) + phase)


def least_std(truth: Mapping[str, float], n: int) -> dict[str, float]:
    """The Cramer-Rao bound of all coefficients of a mixture of n samples, from their spectra at every frequency."""
    sine = 2 * np.sin(np.pi * np.arange(1, n) / (2 * n))
    powers = {"white-noise": 0, "flicker-noise": -1, "rate-random-walk": -2, "quantisation-noise": 2}
    columns = np.column_stack([sine ** powers[name] for name in truth])
    values = np.array(list(truth.values()))
    scaled = 2 * values * columns / (columns @ values**2)[:, None]
    return dict(zip(truth, np.sqrt(np.diag(np.linalg.inv(scaled.T @ scaled / 2))).tolist(), strict=True))
