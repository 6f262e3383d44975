"""Slow noise of a record, each kind with its covariance: flicker out of relaxing traps, flicker by its spectrum, traps
of two levels (random telegraph)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import toeplitz

from tests.benchmark.discovery.layouts import Array


@dataclass(frozen=True)
class Slow:
    """Slow noise of unit variance at the times of a record: values (n, 2), and the covariance of one axis (n, n)."""

    values: Array
    covariance: Array


def none(t_s: Array, random: np.random.Generator) -> Slow:
    return Slow(np.zeros((len(t_s), 2)), np.zeros((len(t_s), len(t_s))))


def traps(t_s: Array, random: np.random.Generator) -> Slow:
    """Seven relaxations, two a decade: flicker over three decades."""
    gap = float(np.median(np.diff(t_s)))
    apart = np.abs(t_s[:, None] - t_s)
    covariance = np.mean([np.exp(-apart / (gap * tau)) for tau in np.geomspace(0.7, 700, 7)], axis=0)
    return Slow(_drawn(covariance, random), covariance)


def spectrum(t_s: Array, random: np.random.Generator) -> Slow:
    """Density 1/f over a time four times as long as the record."""
    n = len(t_s)
    power = 1 / np.maximum(np.fft.rfftfreq(4 * n), 1 / (4 * n))
    power[0] = 0.0
    lags = np.fft.irfft(power)[:n]
    covariance = toeplitz(lags / lags[0])
    return Slow(_drawn(covariance, random), covariance)


def telegraph(t_s: Array, random: np.random.Generator) -> Slow:
    """Three traps, each of two levels, that switch every few poses."""
    gap, apart = float(np.median(np.diff(t_s))), np.abs(t_s[:, None] - t_s)
    stays = gap * random.uniform(3, 25, 3)
    values = np.zeros((len(t_s), 2))
    for stay in stays:
        odd = random.random((len(t_s), 2)) < (1 - np.exp(-2 * np.diff(t_s, prepend=t_s[0])[:, None] / stay)) / 2
        values += np.where(np.cumsum(odd, axis=0) % 2, 1.0, -1.0) * random.choice([-1, 1], 2) / np.sqrt(3)
    return Slow(values, np.mean([np.exp(-2 * apart / stay) for stay in stays], axis=0))


KINDS: tuple[Callable[[Array, np.random.Generator], Slow], ...] = (traps, spectrum, telegraph)


def _drawn(covariance: Array, random: np.random.Generator) -> Array:
    n = len(covariance)
    return np.linalg.cholesky(covariance + 1e-9 * np.eye(n)) @ random.standard_normal((n, 2))
