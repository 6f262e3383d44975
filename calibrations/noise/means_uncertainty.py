"""How much less certain parameters are because the kind of slow noise is not known, only what a record shows of it.

A record says little of noise that is slower than itself, and what wanders so slowly looks like a bias. So the variance
of each parameter is the mean over all slow noise that the residual allows: none, one Gauss-Markov process with a time
constant from a few rows to two records (a random walk, for all that the record can tell), and flicker that goes on
beyond the record; each weighted by its restricted likelihood. Before the data, none is as likely as any.

Source  Hoeting, Madigan, Raftery and Volinsky, Statist. Sci. 14 (1999): Bayesian model averaging.
"""

from __future__ import annotations

import numpy as np

from calibrations.fitting.identifiability import gain
from calibrations.noise.means import BEYOND, Noise
from calibrations.noise.means_fit import NO_SLOW, NoiseSearch, Point, long_enough, scores
from calibrations.table import Array

RATIOS = (0.3, 0.7, 1.4, 2.8)  # slow noise over white and scatter
LENGTHS = (0.03, 0.1, 0.33, 1.0, 2.0)  # of the record: time constants of one process
PER_DECADE = 1.5  # processes of flicker
LEAST_WEIGHT = 1e-4


def widening(noise: Noise, residual: Array, jacobian: Array, typical: Array) -> Array:
    """Factor on each standard uncertainty under `noise`, shape (p,), from residual (channels, n), jacobian (.., p)."""
    points = [NO_SLOW] if noise.given else allowed(noise.gap_s)
    if len(points) == 1 or not jacobian.shape[2]:
        return np.ones(jacobian.shape[2])
    search = NoiseSearch(noise, residual, (jacobian,), np.zeros((residual.shape[1], 0)), points)
    basis, _ = search.beside
    flat = (basis / noise.fast[:, :, None]).reshape(residual.size, -1)
    turned = gain(flat.T @ (jacobian / noise.fast[:, :, None]).reshape(residual.size, -1), typical)
    white = noise.whiten(basis)
    own = _variance((white.T @ white)[None], turned)[0]
    wider = _mean(search, turned) / np.where(own > 0, own, np.inf)
    return np.sqrt(np.where(wider > 0, wider, 1.0))  # what the data hardly determine has no variance to speak of


def allowed(gap_s: Array) -> list[Point]:
    """Slow noise that rows so far apart may have."""
    if not long_enough(gap_s):
        return [NO_SLOW]
    span, gap = float(np.sum(gap_s)), float(np.median(gap_s[1:]))
    single = [(length * span,) for length in LENGTHS if length * span >= 3 * gap]
    count = int(PER_DECADE * np.log10(BEYOND * span / gap)) + 1
    flicker = tuple(np.geomspace(gap / 2, BEYOND * span, count).tolist())
    return [NO_SLOW, *((ratio, taus) for taus in (*single, flicker) for ratio in RATIOS)]


def _mean(search: NoiseSearch, turned: Array) -> Array:
    """Variance of each parameter in the mean over the grid, channels in turn beside the best of the others."""
    best, grams = search.best(), search.grams
    normal = [g.gram[k, :-1, :-1] / s**2 for g, k, s in zip(grams, best.picks, best.scale, strict=True)]
    together = _variance(sum(normal[1:], normal[0])[None], turned)[0]
    mean = together.copy()
    for c, g in enumerate(grams):
        rest = sum((n for d, n in enumerate(normal) if d != c), np.zeros_like(normal[0]))
        score, scale = scores(g, np.pad(rest, (0, 1)), search.residual.shape[1], float(search.least[c]))
        weight = np.exp(-(score - score.min()) / 2) * np.append(len(score) - 1, np.ones(len(score) - 1))
        weight /= weight.sum()
        some = weight > LEAST_WEIGHT
        each = _variance(g.gram[some, :-1, :-1] / scale[some, None, None] ** 2 + rest, turned)
        mean += weight[some] @ each - weight[some].sum() * together
    return np.asarray(mean)


def _variance(information: Array, turned: Array) -> Array:
    """Variances (grid, p) of the parameters from the information (grid, k, k) on the basis."""
    inverse = np.linalg.inv(information)
    return np.asarray(np.einsum("pk,gkl,pl->gp", turned, inverse, turned))
