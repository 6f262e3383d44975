"""Noise processes made without the analysis: each by its own recursion, from a seeded generator."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Random = np.random.Generator


def random_walk(random: Random, n: int) -> Array:
    """Steps of unit variance."""
    return np.cumsum(random.standard_normal(n))


def flicker(random: Random, n: int) -> Array:
    """1 / (2 pi f) by half an integration of white noise, with as long a past (Kasdin, Proc. IEEE 83, 1995)."""
    response = np.ones(2 * n)
    for k in range(1, 2 * n):
        response[k] = response[k - 1] * (k - 0.5) / k
    size = 4 * n
    white = np.fft.rfft(random.standard_normal(2 * n), size)
    return np.fft.irfft(white * np.fft.rfft(response, size), size)[n : 2 * n]


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
