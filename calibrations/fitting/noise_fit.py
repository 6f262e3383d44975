"""The noise of a table's means with the greatest restricted likelihood, and its uncertainty in that of parameters.

The model and any smooth function of the angles are set aside first, so that a misfit that repeats with the angles does
not count as slow noise. Time constants are at most a third of the record, and slow noise is at most a few times the
white noise, so that it does not replace a trend.

A record shows little of noise that is slower than itself, and such noise looks like a bias. So the variance of each
parameter is the mean over all slow noise that the residual allows: none, one Gauss-Markov process with a time constant
from a few rows to two records (a random walk, as far as the record shows), and flicker that continues beyond the
record; each weighted by its restricted likelihood. Before the data, none is as likely as any.

Source  Patterson and Thompson, Biometrika 58 (1971): restricted likelihood; Hoeting, Madigan, Raftery and Volinsky,
        Statist. Sci. 14 (1999): Bayesian model averaging.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calibrations.criteria import FEWEST_FOR_SLOW, INSEPARABLE, NOT_SHOWN
from calibrations.fitting.identifiability import gain
from calibrations.means.kernels import products, profile
from calibrations.means.noise import BEYOND, Noise, Processes, processes, rms
from calibrations.table import Array

LONG = 5000  # rows from which channels are worth a thread each


Point = tuple[float, tuple[float, ...]]  # slow noise over white and scatter, and its time constants
NO_SLOW: Point = (0.0, (1.0,))

RATIOS = (0.2, 0.3, 0.45, 0.7, 1.0, 1.4, 2.0)  # slow noise over white and scatter; more is a drift
FLICKER_RATIOS = (*RATIOS, 2.8, 4.0)  # flicker spreads over all times, and less of it is drift
TIME_CONSTANTS = 4
FLICKER_PROCESSES = 6
ROUNDS = 3
LEAST_STEP = 1e-9  # of the noise: less than this in one round is an exact fit, and no noise
EXACT = 1e-12  # of a parameter's effect: noise below this is rounding


def estimate(start: Noise, residual: Array, jacobian: Array, smooth: Array) -> Noise:
    """The noise, given residual (channels, n), jacobian (channels, n, p) and smooth columns (n, k).

    Scatter adds to the white noise of each row, so that rows of unequal white noise change their weights: the factor
    found is turned into scatter, and the search repeated.
    """
    noise = start
    for _ in range(ROUNDS):
        best = NoiseSearch(noise, residual, (jacobian,), smooth, candidate_noises(noise)).best()
        variance = best.scale**2 * np.mean(noise.fast**2, axis=1) - np.mean(noise.white**2, axis=1)
        scatter = np.sqrt(np.maximum(variance, 0.0))
        noise = replace(noise, scatter=scatter, ratio=best.ratio, taus_s=best.taus_s)
        if np.all(np.abs(best.scale - 1) < 1e-2):
            break
    return noise


def rounding_of(jacobian: Array) -> Array:
    """Residual of each channel by rounding alone, shape (channels,); 0 without parameters."""
    if not jacobian.size:
        return np.zeros(len(jacobian))
    return np.asarray(EXACT * rms(jacobian.swapaxes(1, 2)).max(axis=1))


def gains(noise: Noise, residual: Array, jacobian: Array, extras: Sequence[Array], smooth: Array) -> list[float]:
    """Twice the gain in log-likelihood by each of `extras` (channels, n, k), the noise fitted anew with it.

    Smooth columns are set aside: this is what each explains beside them. Gram matrices are made once for all.
    """
    search = NoiseSearch(noise, residual, (jacobian, *extras), smooth, candidate_noises(noise))
    base_deviance = search.best().deviance
    return [
        max(0.0, base_deviance - search.best(k).deviance) if k in search.further_columns[1] else 0.0
        for k in range(1, len(extras) + 1)
    ]


def candidate_noises(noise: Noise) -> list[Point]:
    """Slow noise to try in addition to known noise; none if a still record has determined it."""
    return [NO_SLOW] if noise.given else grid(noise.gap_s)


def grid(gap_s: Array) -> list[Point]:
    """Slow noise to try on rows so far apart: none, one process, flicker."""
    if not long_enough(gap_s):
        return [NO_SLOW]
    span, gap = float(np.sum(gap_s)), float(np.median(gap_s[1:]))
    single = [(float(tau),) for tau in np.geomspace(3 * gap, span / 3, TIME_CONSTANTS)]
    flicker = tuple(np.geomspace(gap / 2, span / 3, FLICKER_PROCESSES).tolist())
    return [
        NO_SLOW,
        *((ratio, taus) for taus in single for ratio in RATIOS),
        *((ratio, flicker) for ratio in FLICKER_RATIOS),
    ]


def long_enough(gap_s: Array) -> bool:
    """Whether rows at this distance can separate slow noise from white noise."""
    gap = float(np.median(gap_s[1:])) if len(gap_s) > 1 else 0.0
    return len(gap_s) >= FEWEST_FOR_SLOW and gap > 0 and float(np.sum(gap_s)) >= 20 * gap


def deviance(noise: Noise, residual: Array, jacobian: Array, smooth: Array) -> float:
    """-2 log restricted likelihood up to a constant of the data, under the noise of greatest likelihood."""
    return NoiseSearch(noise, residual, (jacobian,), smooth, candidate_noises(noise)).best().deviance


@dataclass(frozen=True)
class Best:
    """The point of greatest likelihood: per channel ratio, time constants and the factor on all noise."""

    ratio: Array
    taus_s: tuple[tuple[float, ...], ...]
    scale: Array
    deviance: float
    picks: tuple[int, ...]  # of the grid


@dataclass(frozen=True)
class NoiseSearch:
    """Likelihood over a grid of slow noise, for the first group of columns alone or with one of the others."""

    noise: Noise
    residual: Array
    groups: tuple[Array, ...]
    smooth: Array
    grid: list[Point]

    @cached_property
    def further_columns(self) -> tuple[Array, tuple[int, ...]]:
        """Orthonormal columns (channels, n, rank) of each group, orthogonal to the smooth columns and the first group.

        Also the number of the group that each comes from.
        """
        channels, n = self.residual.shape
        fast = self.noise.fast[:, :, None]
        Q = [np.linalg.qr(self.smooth / fast[c])[0] for c in range(channels)]
        first = self._extend_basis(self.groups[0], Q, np.zeros((channels * n, 0)))
        additions = [self._extend_basis(group, Q, first) for group in self.groups[1:]]
        origin = np.repeat(
            np.arange(len(self.groups)), [first.shape[1], *(addition.shape[1] for addition in additions)]
        )
        columns = np.hstack([first, *additions]).reshape(channels, n, -1)
        return columns * fast, tuple(origin.tolist())

    def _extend_basis(self, group: Array, smooth: list[Array], first: Array) -> Array:
        """Orthonormal columns (channels * n, rank) of the part that a group adds.

        Columns of few channels come first, so that they stay zero in the others: `profile` needs less time for these.
        """
        free, shape = group / self.noise.fast[:, :, None], (self.residual.size, group.shape[2])
        size = np.linalg.norm(free.reshape(shape), axis=0)
        free = np.stack([free[c] - Q @ (Q.T @ free[c]) for c, Q in enumerate(smooth)]).reshape(shape)
        shown, _ = _orthonormalise(free, range(shape[1]), first, NOT_SHOWN * size)
        channels = np.count_nonzero(group.any(axis=1), axis=0)
        _, basis = _orthonormalise(free, sorted(shown, key=lambda k: channels[k]), first, np.zeros(shape[1]))
        return basis[:, first.shape[1] :]

    @cached_property
    def least(self) -> Array:
        """The least level of each channel's noise, (channels,): what is known to be white, or rounding."""
        white_rms = rms(self.noise.white)
        floor = white_rms if self.noise.known else np.maximum(white_rms, rounding_of(self.groups[0]))
        return np.asarray(np.maximum(floor / rms(self.noise.fast), LEAST_STEP))

    @cached_property
    def grams(self) -> list[Grams]:
        """Gram matrices of each channel, over the grid."""
        basis, _ = self.further_columns
        smooth = np.broadcast_to(self.smooth, (len(basis), *self.smooth.shape))
        columns = np.concatenate([smooth, basis, self.residual[:, :, None]], axis=2)
        fast, gap_s, k = self.noise.fast, self.noise.gap_s, self.smooth.shape[1]
        known_noise = self.noise.given or ((),) * len(basis)

        def of(c: int) -> Grams:
            return _grams(gap_s, fast[c], columns[c], self.grid, k, known_noise[c])

        if len(fast[0]) < LONG:
            return [of(c) for c in range(len(basis))]
        with ThreadPoolExecutor() as pool:
            return list(pool.map(of, range(len(basis))))

    @cached_property
    def _flickers(self) -> NDArray[np.bool_]:
        """Flags of the grid points that are flicker noise or no slow noise."""
        return np.array([len(taus) > 1 or ratio == 0 for ratio, taus in self.grid])

    def _choose(self, score: Array) -> int:
        """The best point; flicker noise where the data cannot separate it from the best.

        Electronics has flicker noise. At long times it is larger than one process, so that steps and trends are judged
        with more caution.
        """
        best = int(np.argmin(score))
        flicker = int(np.argmin(np.where(self._flickers, score, np.inf)))
        return flicker if score[flicker] < score[best] + INSEPARABLE or score[flicker] == score[best] else best

    def best(self, group: int = 0) -> Best:
        """The noise of greatest likelihood with the first group in the model, and another; channels in turn."""
        channels, n = self.residual.shape
        selected = np.flatnonzero([origin in (0, group) for origin in self.further_columns[1]])
        rank = len(selected)
        grams = [g.of(selected) for g in self.grams]
        free = n - self.smooth.shape[1]
        pick, scale = [0] * channels, np.ones(channels)
        for _ in range(4 if channels > 1 else 1):
            previous = list(pick)
            for c in range(channels):
                other_grams = (grams[d].gram[pick[d]] / scale[d] ** 2 for d in range(channels) if d != c)
                other_gram = sum(other_grams, np.zeros((rank + 1, rank + 1)))
                score, scales = scores(grams[c], other_gram, free, float(self.least[c]))
                pick[c] = self._choose(score)
                scale[c] = scales[pick[c]]
            if pick == previous:
                break
        deviance = sum(float(grams[c].logdet[pick[c]] + 2 * n * np.log(scale[c])) for c in range(channels))
        total = sum((grams[c].gram[pick[c]] / scale[c] ** 2 for c in range(channels)), np.zeros((rank + 1, rank + 1)))
        size = np.sqrt(np.maximum(np.diag(total)[:-1], np.finfo(float).tiny))  # channels may differ by many decades
        theta = np.linalg.lstsq(total[:-1, :-1] / np.outer(size, size), total[:-1, -1] / size, rcond=1e-10)[0]
        ratio, taus_s = zip(*(self.grid[k] for k in pick), strict=True)
        square = float(total[-1, -1] - total[:-1, -1] / size @ theta)
        return Best(np.array(ratio), taus_s, scale, deviance + square, tuple(pick))


def _orthonormalise(columns: Array, order: Sequence[int], basis: Array, least: Array) -> tuple[list[int], Array]:
    """Extend an orthonormal basis by columns (n, k): (the numbers of the added columns, the basis with them).

    A column is added if its part orthogonal to the basis is longer than `least` (k,). Gram-Schmidt, twice for each
    column; where columns are zero, their part of the basis is zero.
    """
    taken = []
    for k in order:
        column = columns[:, k] - basis @ (basis.T @ columns[:, k])
        column -= basis @ (basis.T @ column)
        length = np.linalg.norm(column)
        if length > least[k]:
            basis = np.column_stack([basis, column / length])
            taken.append(k)
    return taken, basis


@dataclass(frozen=True)
class Grams:
    """One channel's [J r]^T Sigma^-1 [J r], (grid, p + 1, p + 1), smooth columns set aside, and determinants."""

    gram: Array
    logdet: Array  # of Sigma, (grid,)
    information: Array  # log det S^T Sigma^-1 S of the smooth columns, (grid,)

    def of(self, columns: NDArray[np.intp]) -> Grams:
        """Gram matrices of some of the columns, and of the residual."""
        keep = np.append(columns, self.gram.shape[1] - 1)
        return replace(self, gram=np.ascontiguousarray(self.gram[:, keep[:, None], keep]))


def _grams(gap_s: Array, fast: Array, columns: Array, grid: list[Point], k: int, known_noise: Processes) -> Grams:
    """Gram matrices over the grid; the first `k` columns are set aside (Schur complement)."""
    w = float(rms(fast))
    by_point = [processes(ratio * w, taus, known_noise) for ratio, taus in grid]
    counts = np.array([len(point) for point in by_point])
    padded = np.array([(*point, *((0.0, 1.0),) * (counts.max() - len(point))) for point in by_point])
    used = np.flatnonzero(columns.any(axis=0))  # parameters of other channels change nothing in this one
    slow, tau_s = padded[..., 0], padded[..., 1]
    part, logdet = products(np.ascontiguousarray(columns[:, used]), gap_s, fast, slow, tau_s, counts)
    gram = np.zeros((len(grid), columns.shape[1], columns.shape[1]))
    gram[:, used[:, None], used] = part
    if not k:
        return Grams(gram, logdet, np.zeros(len(grid)))
    S, cross = gram[:, :k, :k], gram[:, :k, k:]
    reduced = gram[:, k:, k:] - np.swapaxes(cross, 1, 2) @ np.linalg.solve(S, cross)
    return Grams(np.ascontiguousarray(reduced), logdet, np.linalg.slogdet(S)[1])


def scores(g: Grams, other_gram: Array, free: int, least: float) -> tuple[Array, Array]:
    """-2 log restricted likelihood up to a constant, and the factor on all noise (profiled), along the grid.

    `free`: number of rows without that of the smooth columns. The parameters of this channel alone are subtracted here.
    """
    scale, own_square, other_square, logdet = profile(g.gram, other_gram, free, least)
    return own_square / scale**2 + other_square + g.logdet + g.information + logdet + 2 * free * np.log(scale), scale


ALLOWED_RATIOS = (0.3, 0.7, 1.4, 2.8)  # slow noise over white and scatter
ALLOWED_LENGTHS = (0.03, 0.1, 0.33, 1.0, 2.0)  # of the record: time constants of one process
ALLOWED_PER_DECADE = 1.5  # processes of flicker
LEAST_WEIGHT = 1e-4


def widening(noise: Noise, residual: Array, jacobian: Array, typical: Array) -> Array:
    """Factor on each standard uncertainty under `noise`, shape (p,), from residual (channels, n), jacobian (.., p)."""
    points = [NO_SLOW] if noise.given else possible_slow_noise(noise.gap_s)
    if len(points) == 1 or not jacobian.shape[2]:
        return np.ones(jacobian.shape[2])
    search = NoiseSearch(noise, residual, (jacobian,), np.zeros((residual.shape[1], 0)), points)
    basis, _ = search.further_columns
    flat = (basis / noise.fast[:, :, None]).reshape(residual.size, -1)
    turned = gain(flat.T @ (jacobian / noise.fast[:, :, None]).reshape(residual.size, -1), typical)
    white = noise.whiten(basis)
    white_variance = _variance((white.T @ white)[None], turned)[0]
    wider = _mean_variance(search, turned) / np.where(white_variance > 0, white_variance, np.inf)
    return np.sqrt(np.where(wider > 0, wider, 1.0))  # the variance of an undetermined parameter has no meaning


def possible_slow_noise(gap_s: Array) -> list[Point]:
    """Slow noise that rows so far apart may have."""
    if not long_enough(gap_s):
        return [NO_SLOW]
    span, gap = float(np.sum(gap_s)), float(np.median(gap_s[1:]))
    single = [(length * span,) for length in ALLOWED_LENGTHS if length * span >= 3 * gap]
    count = int(ALLOWED_PER_DECADE * np.log10(BEYOND * span / gap)) + 1
    flicker = tuple(np.geomspace(gap / 2, BEYOND * span, count).tolist())
    return [NO_SLOW, *((ratio, taus) for taus in (*single, flicker) for ratio in ALLOWED_RATIOS)]


def _mean_variance(search: NoiseSearch, turned: Array) -> Array:
    """Variance of each parameter, shape (p,): the weighted mean over the grid of noise.

    One channel at a time: the other channels keep their best noise. `turned` (p, k) maps the basis to the parameters.
    """
    best, grams = search.best(), search.grams
    normal = [g.gram[k, :-1, :-1] / s**2 for g, k, s in zip(grams, best.picks, best.scale, strict=True)]
    joint_variance = _variance(sum(normal[1:], normal[0])[None], turned)[0]
    mean = joint_variance.copy()
    for c, g in enumerate(grams):
        other_normal = sum((n for d, n in enumerate(normal) if d != c), np.zeros_like(normal[0]))
        score, scale = scores(g, np.pad(other_normal, (0, 1)), search.residual.shape[1], float(search.least[c]))
        weight = np.exp(-(score - score.min()) / 2) * np.append(len(score) - 1, np.ones(len(score) - 1))
        weight /= weight.sum()
        relevant = weight > LEAST_WEIGHT
        variances = _variance(g.gram[relevant, :-1, :-1] / scale[relevant, None, None] ** 2 + other_normal, turned)
        mean += weight[relevant] @ variances - weight[relevant].sum() * joint_variance
    return np.asarray(mean)


def _variance(information: Array, turned: Array) -> Array:
    """Variances (grid, p) of the parameters from the information (grid, k, k) on the basis."""
    inverse = np.linalg.inv(information)
    return np.asarray(np.einsum("pk,gkl,pl->gp", turned, inverse, turned))
