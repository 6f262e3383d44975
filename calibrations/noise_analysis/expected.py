"""The Allan variance that a spectrum makes.

    sigma^2(m) = int S(f) 2 sin^4(pi f m dt) / (m sin(pi f dt))^2 df        over all frequencies of the sampled process

It is exact at one sample as well, where formulas of continuous time are off by up to a half.

Source  NIST SP 1065, 3.2; Percival and Walden, Spectral Analysis for Physical Applications, 8.6.
"""

from __future__ import annotations

import numpy as np

from calibrations.noise_analysis.bands import Bands
from calibrations.noise_analysis.processes import Sampling
from calibrations.table import Array

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
SLOWEST = 1e-7  # in cycles to an averaging time
WHOLE = 8.0  # cycles beyond which a fourth power of a sine is its mean
MEAN = 3 / 8


def steps_of(tau_s: Array, rate_hz: float) -> Array:
    """Averaging times in whole samples, shape of `tau_s`."""
    return np.asarray(np.maximum(1, np.round(tau_s * rate_hz)))


def weighted(m: float, rate_hz: float, corner_hz: float) -> tuple[Bands, Array]:
    """Frequencies at which spectra are asked, and what to add them up with to a variance at `m` samples, (k,)."""
    cycles, width = _nodes(m / 2)
    f = cycles * rate_hz / m
    sine = np.sin(np.pi * f / rate_hz)
    power = np.where(cycles < WHOLE, np.sin(np.pi * cycles) ** 4, MEAN)
    none = np.zeros(len(f))
    at = Bands(f, none, none, Sampling(rate_hz), none, corner_hz)
    return at, 2 * width * rate_hz / m * 2 * power / (m * sine) ** 2


def of_line(turns: float, m: Array) -> Array:
    """Variance at `m` samples of a sinusoid of unit amplitude, `turns` of it to a sample."""
    return np.asarray(np.sin(np.pi * turns * m) ** 4 / (m * np.sin(np.pi * turns)) ** 2)


def _nodes(end: float) -> tuple[Array, Array]:
    """Gauss's nodes and weights from 0 to `end` cycles, in panels: fine where the sine turns, else by decades."""
    fine = np.arange(0.25, min(end, WHOLE) + 0.25, 0.25)
    slow, fast = np.geomspace(SLOWEST, 0.25, 30), np.geomspace(WHOLE, max(end, WHOLE), 60)
    edges = np.unique(np.concatenate([[0.0], slow, fine, fast]))
    edges = np.append(edges[edges < end], end)
    half = np.diff(edges)[:, None] / 2
    return ((edges[:-1, None] + half) + half * NODES).ravel(), (half * WEIGHTS).ravel()
