"""How many degrees of freedom a deviation has: its variance is distributed as chi-square over that many.

    edf = z(0)^2 / mean over all pairs of windows of z(t)^2       z: autocovariance of the differences, t: their lag

where z follows from the noise type, the order of the difference, and whether the phase is averaged.

Source  Greenhall and Riley, Proc. 35th PTTI (2003); NIST SP 1065, 5.4 (the total deviation: 5.4.3).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.special import xlogy
from scipy.stats import chi2

from calibrations.table import Array

COVERAGE = 0.95
LARGEST_FILTER = 1024  # samples to an averaging time beyond which it might as well be continuous
SHORT = 32  # samples to an averaging time below which a total deviation is an overlapping one
MOST_OVERLAP = 64  # windows to an averaging time beyond which more say nothing, but of noise of the phase
ORDERS: Mapping[str, tuple[int, bool]] = MappingProxyType(  # order of the difference, phase averaged
    {"overlapping": (2, False), "allan": (2, False), "modified": (2, True), "hadamard": (3, False),
     "separate-hadamard": (3, False)}
)  # fmt: skip
TOTAL: Mapping[int, tuple[float, float]] = MappingProxyType({0: (1.5, 0.0), -1: (1.168, 0.222), -2: (0.927, 0.358)})
COVARIANCES: Mapping[int, Callable[[Array], Any]] = MappingProxyType(
    {
        2: lambda t: -np.abs(t),
        1: lambda t: xlogy(t**2, np.abs(t)),
        0: lambda t: np.abs(t) ** 3,
        -1: lambda t: -xlogy(t**4, np.abs(t)),
        -2: lambda t: -(np.abs(t) ** 5),
        -3: lambda t: xlogy(t**6, np.abs(t)),
        -4: lambda t: np.abs(t) ** 7,
    }
)


def freedom(kind: str, alpha: int, n: int, m: int, overlap: int) -> float:
    """Equivalent degrees of freedom, at least 1.

    kind     of `exact.KINDS`
    alpha    the spectrum of the values goes as f^alpha: 2 quantisation, 0 white, -1 flicker, -2 random walk
    n, m     samples of the record, and to an averaging time
    overlap  windows to an averaging time: m is every one, 1 none
    """
    if kind == "total" and m < SHORT:
        kind = "overlapping"
    if kind == "total":
        b, c = TOTAL[max(-2, min(0, alpha))]
        return max(1.0, b * n / m - c)
    order, averaged = ORDERS[kind]
    alpha = max(alpha, 1 - 2 * order + 1)  # of steeper noise the difference has no variance
    length = m if averaged else 1
    windows = 1 + max(0, (n + 1 - length - order * m) * overlap // m)
    lags = np.arange(1, min(windows, (order + 1) * overlap))
    factor = 1.0 if averaged else (float(m) if m <= LARGEST_FILTER or alpha > 0 else np.inf)
    z = _autocovariance(np.concatenate([[0.0], lags / overlap]), factor, alpha, order)
    pairs = z[0] ** 2 + 2 * np.sum((1 - lags / windows) * z[1:] ** 2)
    return max(1.0, float(windows * z[0] ** 2 / pairs))


def overlap_of(kind: str, m: int, alpha: int) -> int:
    """Windows to an averaging time that count, where all are used."""
    if kind in ("allan", "separate-hadamard"):
        return 1
    return m if alpha > 0 else min(m, MOST_OVERLAP)


def interval(deviation: float, edf: float) -> tuple[float, float]:
    """The bounds between which the true deviation lies with a probability of COVERAGE."""
    tail = (1 - COVERAGE) / 2
    low, high = (deviation * float(np.sqrt(edf / chi2.ppf(p, edf))) for p in (1 - tail, tail))
    return low, high


def _autocovariance(t: Array, factor: float, alpha: int, order: int) -> Array:
    """Of differences of the given order, but for a constant factor; t in averaging times."""
    weights = {2: (6, -4, 1), 3: (20, -15, 6, -1)}[order]
    total = weights[0] * _averaged(t, factor, alpha)
    for lag, weight in enumerate(weights[1:], 1):
        total = total + weight * (_averaged(t - lag, factor, alpha) + _averaged(t + lag, factor, alpha))
    return np.asarray(total)


def _averaged(t: Array, factor: float, alpha: int) -> Array:
    """Generalised autocovariance of the phase, averaged over 1 / factor of an averaging time, each way."""
    if np.isinf(factor):
        return np.asarray(COVARIANCES[alpha + 2](t))
    w, step = COVARIANCES[alpha], 1 / factor
    return np.asarray(factor**2 * (2 * w(t) - w(t - step) - w(t + step)))
