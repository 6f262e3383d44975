"""Noise of a table's means: white, whose level is known from the samples, scatter and slow noise, which are fitted.

    Sigma = W + k^2 I + (rho w)^2 G(tau)

per channel. W: the white variances of the means. k: scatter from row to row beyond the white noise. G: a Gauss-Markov
process of time constant tau, w the rms of white noise and scatter. All by maximum likelihood, profiled over the model's
parameters. tau is at most a third of the record, so that slow noise cannot take the place of a trend. Where the white
noise is not known, W is zero and k takes its place.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calibrations.kernels import whiten
from calibrations.table import Array

RATIOS = np.concatenate([[0.0], 0.2 * 1.5 ** np.arange(16)])
FEWEST_FOR_SLOW = 20  # rows below which slow noise cannot be told from white
TIME_CONSTANTS = 5
ROUNDS = 3


@dataclass(frozen=True)
class Noise:
    """Noise of each mean, in the residual's unit. `white` has shape (channels, n), the others are per channel."""

    white: Array
    gap_s: Array
    scatter: Array
    ratio: Array
    tau_s: Array

    @property
    def known(self) -> bool:
        """Whether the white noise is known from the samples."""
        return bool(self.white.any())

    @property
    def fast(self) -> Array:
        """White noise and scatter of each mean, shape (channels, n)."""
        return np.asarray(np.hypot(self.white, self.scatter[:, None]))

    @property
    def floor(self) -> Array:
        """The noise floor: the white noise of one mean, rms over rows; the scatter where that is not known."""
        return rms(self.white) if self.known else self.scatter

    @property
    def slow(self) -> Array:
        """Standard deviation of the slow noise."""
        return self.ratio * rms(self.fast)

    def whiten(self, columns: Array) -> Array:
        """(channels, n, k) -> (channels * n, k), each row of unit variance and independent of the others."""
        return np.concatenate([self._whiten_channel(c, columns[c])[0] for c in range(len(columns))])

    def _whiten_channel(self, c: int, columns: Array) -> tuple[Array, float]:
        slow, tau = float(self.slow[c]), float(self.tau_s[c])
        out, logdet = whiten(np.ascontiguousarray(columns), self.gap_s, self.fast[c], slow, tau)
        return out, float(logdet)

    @cached_property
    def logdet(self) -> float:
        """log det Sigma over all channels."""
        empty = np.zeros((self.white.shape[1], 0))
        return sum(self._whiten_channel(c, empty)[1] for c in range(len(self.white)))


def rms(x: Array) -> Array:
    """Root mean square along the last axis."""
    return np.asarray(np.sqrt(np.mean(x * x, axis=-1)))


def white_only(white: Array | None, gap_s: Array, channels: int) -> Noise:
    """The noise before anything is fitted."""
    ones = np.ones(channels)
    if white is None:
        return Noise(np.zeros((channels, len(gap_s))), gap_s, ones, 0 * ones, ones)
    return Noise(white, gap_s, 0 * ones, 0 * ones, ones)


def estimate(start: Noise, residual: Array, jacobian: Array) -> Noise:
    """The noise of greatest likelihood, the model's parameters profiled out to first order.

    residual (channels, n), jacobian (channels, n, p). Scatter adds to the white noise of each row, so that rows of
    unequal white noise change their weights: the scale found is turned into scatter, and the search repeated.
    """
    noise = start
    for _ in range(ROUNDS):
        fast = noise.fast
        pick, scale = _search(noise, fast, residual, jacobian)
        variance = scale**2 * np.mean(fast**2, axis=1) - np.mean(noise.white**2, axis=1)
        noise = replace(
            noise,
            scatter=np.sqrt(np.maximum(variance, 0.0)),
            ratio=np.array([ratio for ratio, _ in pick]),
            tau_s=np.array([tau for _, tau in pick]),
        )
        if np.all(np.abs(scale - 1) < 1e-3):
            break
    return noise


def _search(noise: Noise, fast: Array, residual: Array, jacobian: Array) -> tuple[list[tuple[float, float]], Array]:
    """(ratio, tau) and the factor on all noise of greatest likelihood, per channel, the others held in turn."""
    channels, n, p = jacobian.shape
    columns = np.concatenate([_orthonormal(fast, jacobian), residual[:, :, None]], axis=2)
    grid = _grid(noise.gap_s, n)
    grams = [_grams(noise.gap_s, fast[c], columns[c], grid) for c in range(channels)]
    least = rms(noise.white) / rms(fast)
    pick, scale = [0] * channels, np.ones(channels)
    for _ in range(4 if channels > 1 else 1):
        before = list(pick)
        for c in range(channels):
            others = (grams[d].gram[pick[d]] / scale[d] ** 2 for d in range(channels) if d != c)
            score, scales = _scores(grams[c], sum(others, np.zeros((p + 1, p + 1))), n, float(least[c]))
            pick[c] = int(np.argmin(score))
            scale[c] = scales[pick[c]]
        if pick == before:
            break
    return [grid[k] for k in pick], scale


@dataclass(frozen=True)
class _Grams:
    """[J r]^T Sigma^-1 [J r] (grid, p + 1, p + 1) and log det Sigma (grid,) of one channel, before scaling."""

    gram: Array
    logdet: Array


def _grid(gap_s: Array, n: int) -> list[tuple[float, float]]:
    """(ratio, tau) to try."""
    span, gap = float(np.sum(gap_s)), float(np.median(gap_s[1:])) if n > 1 else 1.0
    if n < FEWEST_FOR_SLOW or gap <= 0 or span < 20 * gap:
        return [(0.0, 1.0)]
    taus = np.geomspace(3 * gap, span / 3, TIME_CONSTANTS)
    return [(0.0, 1.0), *((float(r), float(t)) for t in taus for r in RATIOS[1:])]


def _orthonormal(white: Array, jacobian: Array) -> Array:
    """Columns that span the jacobian's, of unit norm under the white noise: sums of products stay well conditioned."""
    channels, n, p = jacobian.shape
    if not p:
        return jacobian
    scaled = (jacobian / white[:, :, None]).reshape(channels * n, p)
    norm = np.linalg.norm(scaled, axis=0)
    U, s, _ = np.linalg.svd(scaled / np.where(norm > 0, norm, 1.0), full_matrices=False)
    U[:, s < 1e-10 * s[0]] = 0.0
    return U.reshape(channels, n, p) * white[:, :, None]


def _grams(gap_s: Array, fast: Array, columns: Array, grid: list[tuple[float, float]]) -> _Grams:
    w = float(rms(fast))
    made = [whiten(np.ascontiguousarray(columns), gap_s, fast, ratio * w, tau) for ratio, tau in grid]
    return _Grams(np.stack([out.T @ out for out, _ in made]), np.array([logdet for _, logdet in made]))


def _scores(g: _Grams, rest: Array, n: int, least: float) -> tuple[Array, Array]:
    """-2 log likelihood up to a constant, and the factor on all noise (profiled), at each point of the grid."""
    scale = np.ones(len(g.gram))
    ridge = 1e-13 * np.eye(len(rest) - 1)
    for _ in range(3):
        total = g.gram / scale[:, None, None] ** 2 + rest
        size = np.trace(total[:, :-1, :-1], axis1=1, axis2=2)[:, None, None]
        theta = np.linalg.solve(total[:, :-1, :-1] + ridge * size, total[:, :-1, -1:])[:, :, 0]
        extended = np.concatenate([-theta, np.ones((len(theta), 1))], axis=1)
        rss = np.einsum("gi,gij,gj->g", extended, g.gram, extended)
        scale = np.maximum(np.sqrt(np.maximum(rss, 0.0) / n), max(least, 1e-300))
    other = np.einsum("gi,ij,gj->g", extended, rest, extended)
    return rss / scale**2 + other + g.logdet + 2 * n * np.log(scale), scale
