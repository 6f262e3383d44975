"""What a residual shows, in words: the plainest pattern, the poses that stand out, or more noise than a sensor has.

A pattern is found under the fitted noise, and compared with others by likelihood under the noise without its slow part,
which would take up steps and ramps alike. The best few are sharpened before: which row a step is at, how wide a sector,
whether from one side only. Poses that stand out compete with them, and pay for each pose and for the choice of it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, ndtri

from calibrations.fit import Fit
from calibrations.noise import rms
from calibrations.noise_estimation.mean_noise import correlation_known
from calibrations.search.candidates import SIGNIFICANT
from calibrations.search.outliers import told
from calibrations.search.patterns import Pattern, one_sided, patterns, per_channel
from calibrations.search.screen import Screen, Search
from calibrations.search.share import MOST_NOISE
from calibrations.table import Array

MOST_OUT = 1 / 10  # of the poses: more do not stand out
FINALISTS = 6  # patterns that are sharpened
NAMED = 6  # poses that are told one by one
MOST_LEFT = 1 / 5  # of the excess variance, by a pattern that slow noise could look like


def structure_of(fit: Fit) -> Pattern | None:
    """The plainest pattern in a fit's residual; None where there is none beyond noise."""
    screen, noise = Screen(without_slow(fit)), _patternless(fit)
    every = patterns(fit.table, fit.channels)
    found = _significant(every, Screen(fit)) or ([p for p in every if p.slow] if noise else [])
    found = sorted(found, key=lambda p: worth(p, screen), reverse=True)[:FINALISTS]
    sharp = [sharpened(pattern, screen) for pattern in (*found, *_out(fit))]
    sharp = [p for p in sharp if not (p.slow and noise) or _share_left(p, screen) < MOST_LEFT]
    return max(sharp, key=lambda p: worth(p, screen), default=noise)


def _share_left(pattern: Pattern, screen: Screen) -> float:
    """Part of the residual's excess over white noise that the pattern leaves: slow noise leaves much of its own."""
    fit, columns = screen.fit, pattern.columns.reshape(screen.fit.residual.size, -1)
    J = np.hstack([fit.jacobian.reshape(fit.residual.size, -1), columns])
    size = np.linalg.norm(J, axis=0)
    J = J / np.where(size > 0, size, 1.0)
    r = fit.residual.ravel()
    left = (r - J @ np.linalg.lstsq(J, r, rcond=1e-9)[0]).reshape(fit.residual.shape)
    after = float(np.mean((rms(left) / fit.noise.floor) ** 2))
    return max(after - 1, 0.0) / max(fit.pooled_excess**2 - 1, 1e-9)


def without_slow(fit: Fit) -> Fit:
    """The fit with the slow part of its noise left out."""
    return replace(fit, noise=replace(fit.noise, ratio=np.zeros_like(fit.noise.ratio)))


def worth(pattern: Pattern, screen: Screen) -> float:
    """Twice the log-likelihood with the pattern less the price of its parameters, up to a constant."""
    basis = screen.basis(pattern.columns)
    left = float(screen.residual @ screen.residual) - screen.statistic(basis)
    return likelihood(left, basis.shape[1], screen.fit) - pattern.price


def likelihood(squares: float, parameters: int, fit: Fit) -> float:
    """Twice the log-likelihood of a sum of whitened squares, less log(rows) for each parameter (Schwarz)."""
    rows = fit.residual.size
    return -rows * float(np.log(max(squares, 1e-300) / rows)) - parameters * float(np.log(rows))


def _significant(every: list[Pattern], screen: Screen) -> list[Pattern]:
    """The patterns that noise alone would hardly show."""
    tried = [(p, screen.basis(p.columns)) for p in every]
    tried = [(p, basis) for p, basis in tried if basis.shape[1]]
    chances = Search(screen, [basis for _, basis in tried]).p_values
    return [p for (p, _), chance in zip(tried, chances, strict=True) if chance < SIGNIFICANT]


def sharpened(pattern: Pattern, screen: Screen) -> Pattern:
    """The best of the pattern and those between it and its neighbours, on both sides or on one."""
    table, channels = screen.fit.table, len(screen.fit.channels)
    near = [pattern, *(per_channel(p, channels) for p in pattern.finer() if np.ptp(p.columns) > 0)]
    best = near[int(np.argmax(screen.reductions([p.columns for p in near])))]
    return max([best, *one_sided(best, table)], key=lambda p: worth(p, screen))


def _out(fit: Fit) -> list[Pattern]:
    """The poses that stand out; none where there are none, or too many."""
    rows, n = standing_out(fit.residual, np.hypot(fit.noise.floor, fit.noise.wander)), fit.table.n
    if fit.table.kind == "motion" or not 0 < len(rows) <= max(1, MOST_OUT * n):
        return []
    columns = per_channel(Pattern("", np.eye(n)[:, rows]), len(fit.channels)).columns
    choices = gammaln(n + 1) - gammaln(len(rows) + 1) - gammaln(n - len(rows) + 1)
    numbers = tuple(map(int, fit.table.numbered(rows)))
    return [Pattern(told(numbers, fit.table.kind, NAMED), columns, price=2 * float(choices), poses=numbers)]


def standing_out(residual: Array, noise: Array) -> NDArray[np.intp]:
    """Rows whose residual (channels, n) is too large to be noise of the others' spread, by medians.

    The spread is not less than `noise` (channels,), the white and the slow: medians of slow noise are uncertain.
    """
    middle = np.median(residual, axis=1, keepdims=True)
    spread = 1.4826 * np.median(np.abs(residual - middle), axis=1, keepdims=True)
    spread = np.maximum(spread, noise[:, None])
    most = -ndtri(SIGNIFICANT / 2 / residual.size)
    return np.flatnonzero(np.any(np.abs(residual - middle) > most * spread, axis=0))


def _patternless(fit: Fit) -> Pattern | None:
    """More noise than a sensor makes by itself. On positions it is how well a hand repeats them, and no effect."""
    excess = rms(fit.rmse / np.hypot(fit.noise.floor, fit.noise.known_slow))
    if fit.table.kind == "positions" or not fit.noise.known or excess <= MOST_NOISE:
        return None
    slow, scatter = (float(np.max(noise / fit.noise.floor)) for noise in (fit.noise.slow, fit.noise.scatter))
    if scatter > slow and not correlation_known(fit.table):
        return None  # the means may be of so few independent samples
    what = "slow drift" if slow > scatter else "scatter"
    return Pattern(f"{what} without a pattern, {max(slow, scatter):.1f} x the noise floor", np.zeros((0, 0, 0)))
