"""Noise processes made without the analysis: each by its own recursion, from a seeded generator."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Random = np.random.Generator
PAST = 8


def random_walk(random: Random, n: int) -> Array:
    """Steps of unit variance."""
    return np.cumsum(random.standard_normal(n))


def flicker(random: Random, n: int) -> Array:
    """1 / (2 pi f): white noise integrated by half, with a past of seven lengths (Kasdin, Proc. IEEE 83, 1995)."""
    k = np.arange(1, PAST * n)
    response = np.concatenate([[1.0], np.cumprod((k - 0.5) / k)])
    white = np.fft.rfft(random.standard_normal(PAST * n), 2 * PAST * n)
    return np.fft.irfft(white * np.fft.rfft(response, 2 * PAST * n), 2 * PAST * n)[(PAST - 1) * n : PAST * n]


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
