"""Deviations of samples over averaging time: at octave times in one pass, or at any time; the minimum of a curve.

    sigma^2(m) = mean((x[i+2m] - 2 x[i+m] + x[i])^2) / (2 m^2)        x: running sum of the values

The Hadamard deviation has the third difference and a divisor of 6. The modified deviation averages the phase over m
samples. The total deviation extends the record by its own mirror image at both ends.

Octave times need constant memory. Up to 32 samples every overlap is used. A longer time is divided into 32 bins, and
windows begin at each bin: for white noise the variance of the estimate is 1.0012 times that of every overlap, for
redder noise less. (For phase noise alone, such as quantisation noise, `deviations` uses every overlap and is more
precise.) Sums are kept of differences from the first block, over a few thousand bins, so that no digits are lost.

A variance is distributed as chi-squared over its equivalent degrees of freedom (edf):

    edf = z(0)^2 / mean over all pairs of windows of z(t)^2       z: autocovariance of the differences, t: their lag

z follows from the power law of the noise, S(f) ~ f^alpha. alpha follows from the correlation of neighbouring means:
fractionally integrated noise of order d < 1/2 has the lag-1 autocorrelation d / (1 - d), and alpha = -2 d; redder noise
is differenced first.

A minimum is significant if the deviation at some longer time is higher by more than chance. The ratio of two variances
is distributed as F over their edf; the limit is divided by the number of pairs of times (Bonferroni).

Source  IEEE 952, annex C; NIST SP 1065, 5.2 to 5.5; Greenhall, IEEE Trans. UFFC 50 (2003): stride; Greenhall and Riley,
        Proc. 35th PTTI (2003): edf; Riley and Greenhall, Proc. 18th EFTF (2004): noise type.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.special import chdtri, fdtrc, xlogy

from calibrations.criteria import COVERAGE, FALSE_MINIMUM, FEWEST_MEANS
from calibrations.errors import DataError, TooFewRows
from calibrations.noise.kernels import (
    ALLAN,
    FACTORS,
    HADAMARD,
    MODIFIED,
    Tree,
    absorb,
    empty_tree,
    finish,
    reflected_squares,
    second_order,
)
from calibrations.table import Array

OVERLAPPING = "overlapping"  # the kind that models are compared with
BLOCK = 1 << 17  # samples that are taken at a time
OCTAVE_KINDS: Mapping[str, tuple[int, float]] = MappingProxyType(  # kept squares, divisor
    {OVERLAPPING: (ALLAN, 2.0), "modified": (MODIFIED, 2.0), "hadamard": (HADAMARD, 6.0), "total": (ALLAN, 2.0)}
)


@dataclass(frozen=True)
class DeviationCurve:
    """A deviation over averaging time; shapes (k,), in the unit of the values, intervals of 95 %."""

    kind: str
    tau_s: Array
    deviation: Array
    low: Array
    high: Array
    alpha: tuple[int, ...]  # the noise type at each time
    edf: Array


class Octaves:
    """The statistics of a record so far. Add blocks in order, and call `curve` at the end.

    Differences of the third order, for modified and hadamard, take as long again: False leaves them out.
    """

    def __init__(self, rate_hz: float, third_order: bool = True) -> None:
        self._rate_hz = rate_hz
        self._third = third_order
        self._offset: float | None = None
        self._tree = empty_tree()
        self._whole: Tree | None = None
        self._curves: dict[str, DeviationCurve] = {}

    def add(self, samples: Array) -> None:
        """The next samples, of any real type, shape (n,)."""
        for start in range(0, len(samples), BLOCK):
            part = np.ascontiguousarray(samples[start : start + BLOCK], dtype=np.float64)
            if self._offset is None:
                self._offset = float(part.mean())
            absorb(self._tree, part, self._offset, self._third)
        self._whole = None
        self._curves = {}

    @property
    def n(self) -> int:
        """Samples so far."""
        return int(self._tree.bin_counts[0])

    def curve(self, kind: str = OVERLAPPING) -> DeviationCurve:
        """The deviation at 1, 2, 4 ... samples, as far as the record has two windows (hadamard: three)."""
        if kind not in self._curves:
            self._curves[kind] = self._curve(kind)
        return self._curves[kind]

    def _curve(self, kind: str) -> DeviationCurve:
        if self._whole is None:
            self._whole = deepcopy(self._tree)
            finish(self._whole, self._third)
        points = [_point(self._whole, kind, octave) for octave in range(self.n.bit_length())]
        rows = [point for point in points if point is not None]
        tau_s = np.array([2.0**octave for octave, _ in enumerate(rows)]) / self._rate_hz
        value, edf = (np.array([row[k] for row in rows], dtype=float) for k in (0, 1))
        bounds = np.array([interval(*row[:2]) for row in rows]).reshape(-1, 2)
        return DeviationCurve(kind, tau_s, value, bounds[:, 0], bounds[:, 1], tuple(row[2] for row in rows), edf)


def octaves(blocks: Iterable[Array], rate_hz: float, kind: str = OVERLAPPING) -> DeviationCurve:
    """The curve of a record that comes in blocks, shape (n,) each."""
    reduction = Octaves(rate_hz, OCTAVE_KINDS[kind][0] != ALLAN)
    for block in blocks:
        reduction.add(block)
    return reduction.curve(kind)


def _point(tree: Tree, kind: str, octave: int) -> tuple[float, float, int] | None:
    """(deviation, degrees of freedom, noise type) at 2^octave samples; None where the record is too short."""
    level, factor = max(0, octave - FACTORS + 1), min(octave, FACTORS - 1)
    order, divisor = OCTAVE_KINDS[kind]
    index = (level, factor if level == 0 else 0, order)
    number, total = int(tree.windows[index]), float(tree.squares[index])
    if not number:
        return None
    m, bins = 2.0**octave, 2**factor
    if kind == "total":
        total, number = total + _ends(tree, level, bins), int(tree.bin_counts[level]) - 1
    variance = total / number / divisor / (m**4 if kind == "modified" else m**2)
    alpha = _octave_noise_type(tree, octave)
    return float(np.sqrt(variance)), freedom(kind, alpha, int(tree.bin_counts[0]), int(m), bins), alpha


def _ends(tree: Tree, level: int, bins: int) -> float:
    """Squares of the windows that reach beyond the record's ends."""
    tail = tree.sums[level, : tree.filled[level]][::-1].copy()
    return reflected_squares(tree.heads[level], bins) + reflected_squares(tail, bins)


def _octave_noise_type(tree: Tree, octave: int) -> int:
    """The noise type at an averaging time, estimated at the longest time up to it that has enough means."""
    for level in range(octave, -1, -1):
        alpha = noise_type(int(tree.bin_counts[level]), tree.moments[level])
        if alpha is not None:
            return alpha
    return 0


LARGEST_FILTER = 1024  # samples to an averaging time beyond which it might as well be continuous
SHORT = 32  # samples to an averaging time below which a total deviation is an overlapping one
MOST_OVERLAP = 64  # windows to an averaging time beyond which more say nothing, but of noise of the phase
ORDERS: Mapping[str, tuple[int, bool]] = MappingProxyType(  # order of the difference, phase averaged
    {OVERLAPPING: (2, False), "modified": (2, True), "hadamard": (3, False)}
)
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


@lru_cache(maxsize=1024)  # records of one length have them in common
def freedom(kind: str, alpha: int, n: int, m: int, overlap: int) -> float:
    """Equivalent degrees of freedom, at least 1.

    kind     of OCTAVE_KINDS
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


def overlap_of(m: int, alpha: int) -> int:
    """Windows to an averaging time that count, where all are used."""
    return m if alpha > 0 else min(m, MOST_OVERLAP)


def interval(deviation: float, edf: float) -> tuple[float, float]:
    """The bounds between which the true deviation lies with a probability of COVERAGE."""
    tail = (1 - COVERAGE) / 2
    low, high = (deviation * float(np.sqrt(edf / chdtri(edf, p))) for p in (tail, 1 - tail))
    return low, high


def _autocovariance(t: Array, factor: float, alpha: int, order: int) -> Array:
    """Autocovariance of differences of the given order, except for a constant factor; t in averaging times."""
    weights = {2: (6, -4, 1), 3: (20, -15, 6, -1)}[order]
    total = weights[0] * _average_autocovariance(t, factor, alpha)
    for lag, weight in enumerate(weights[1:], 1):
        total = total + weight * (
            _average_autocovariance(t - lag, factor, alpha) + _average_autocovariance(t + lag, factor, alpha)
        )
    return np.asarray(total)


def _average_autocovariance(t: Array, factor: float, alpha: int) -> Array:
    """Generalised autocovariance of the phase, averaged over 1 / factor of an averaging time, each way."""
    if np.isinf(factor):
        return np.asarray(COVARIANCES[alpha + 2](t))
    w, step = COVARIANCES[alpha], 1 / factor
    return np.asarray(factor**2 * (2 * w(t) - w(t - step) - w(t + step)))


STATIONARY = 0.25  # order of integration up to which noise need not be differenced
REDDEST, BLUEST = -3, 2


def noise_type(n: int, moments: Sequence[float] | Array) -> int | None:
    """The noise type alpha, from 2 (quantisation) to -3; None if the means are too few or all equal.

    n means z with the differences w: moments are the sums of z, z^2, z z', w^2 and w w' (' is the one before).
    """
    z, zz, lagged, ww, w_lagged = moments
    mean = z / n if n else 0.0
    variance = zz - n * mean**2
    if n < FEWEST_MEANS or not variance > 1e-12 * zz or not ww > 0:
        return None
    order = _order((lagged - (n - 1) * mean**2) / variance)
    if order >= STATIONARY:
        order = 1 + _order(w_lagged / ww)
    return int(np.clip(round(-2 * order), REDDEST, BLUEST))


def moments_of(z: Array) -> tuple[float, float, float, float, float]:
    """The sums that `noise_type` takes, of means shape (n,)."""
    w = np.diff(z)
    return float(z.sum()), float(z @ z), float(z[1:] @ z[:-1]), float(w @ w), float(w[1:] @ w[:-1])


def _order(correlation: float) -> float:
    return correlation / (1 + correlation) if correlation > -1 else -1.0


def deviations(values: Array, steps: Iterable[int]) -> Array:
    """Overlapping Allan deviation of `values`, shape (n,), over each of `steps` samples; nan in too short a record.

    Raises DataError for values that are no numbers, and for steps below 1.
    """
    counts = [int(m) for m in steps]
    if min(counts, default=1) < 1:
        raise DataError(f"an averaging time of {min(counts)} samples; it is 1 or more")
    values = np.ascontiguousarray(values, dtype=np.float64)
    if not np.isfinite(values).all():
        row = int(np.argmin(np.isfinite(values)))
        raise DataError(f"row {row + 1} is {values[row]:g}, not a number; take a stretch of the record without gaps")
    phase = np.concatenate([[0.0], np.cumsum(values - values.mean() if len(values) else values)])
    return np.array([_deviation(phase, m) for m in counts])


def _deviation(phase: Array, m: int) -> float:
    windows = len(phase) - 2 * m
    return float(np.sqrt(second_order(phase, m, 0) / windows / 2) / m) if windows > 0 else np.nan


def curve_at(values: Array, rate_hz: float, tau_s: Sequence[float], source: str) -> DeviationCurve:
    """Allan deviations of values (n,) at averaging times (k,), each rounded to a whole number of samples.

    Raises DataError for a time below one sample, TooFewRows for one of which the record does not hold two.
    """
    steps = [_steps(tau, len(values), rate_hz, source) for tau in tau_s]
    deviation = deviations(values, steps)
    alphas = tuple(_noise_type_at(values, m) for m in steps)
    edf = np.array(
        [freedom(OVERLAPPING, a, len(values), m, overlap_of(m, a)) for a, m in zip(alphas, steps, strict=True)]
    )
    bounds = np.array([interval(*pair) for pair in zip(deviation.tolist(), edf.tolist(), strict=True)])
    return DeviationCurve(OVERLAPPING, np.array(steps) / rate_hz, deviation, bounds[:, 0], bounds[:, 1], alphas, edf)


def _steps(tau_s: float, n: int, rate_hz: float, source: str) -> int:
    """Samples to an averaging time."""
    m = round(tau_s * rate_hz)
    if m < 1:
        raise DataError(f"{source}: an averaging time of {tau_s:g} s is shorter than one sample, {1 / rate_hz:g} s")
    if 2 * m > n:
        raise TooFewRows(
            f"{source}: an averaging time of {tau_s:g} s needs a record of {2 * tau_s:g} s or more, and this one has "
            f"{n / rate_hz:g} s; ask for {n / rate_hz / 2:g} s at most"
        )
    return m


def _noise_type_at(values: Array, m: int) -> int:
    """The noise type at m samples, or at the longest shorter time for which the record has enough means."""
    m = max(1, min(m, len(values) // FEWEST_MEANS))
    means = values[: len(values) // m * m].reshape(-1, m).mean(axis=1)
    return noise_type(len(means), moments_of(means - means.mean())) or 0


def minimum_s(curve: DeviationCurve) -> float | None:
    """The averaging time, s, of the lowest deviation, where some longer one is higher by more than chance."""
    lowest = int(np.argmin(curve.deviation))
    longer = curve.tau_s > curve.tau_s[lowest]
    ratio = (curve.deviation[longer] / curve.deviation[lowest]) ** 2
    chance = fdtrc(curve.edf[longer], curve.edf[lowest], ratio)
    pairs = len(curve.tau_s) * (len(curve.tau_s) - 1) / 2
    return float(curve.tau_s[lowest]) if np.any(pairs * chance < FALSE_MINIMUM) else None
