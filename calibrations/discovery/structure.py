"""What a residual shows, in words: the plainest pattern, the poses that stand out, or more noise than a sensor has.

A pattern is found under the fitted noise, and compared with others by likelihood under the noise without its slow part,
which would take up steps and ramps alike. The best few are sharpened before: which row a step is at, how wide a sector,
whether from one side only. Poses that stand out compete with them, and pay for each pose and for the choice of it.

Patterns compete with effects as well: a step in time looks like a drift to a catalogue without steps. A pattern that
describes the residual better than all effects found means that the cause is not in the catalogue.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, ndtri

from calibrations.criteria import (
    MATERIAL,
    MOST_ROWS_STAND_OUT,
    MOST_SLOW_NOISE,
    MOST_UNDER_SLOW_PATTERN,
    MOST_UNSEEN,
    PATTERN_BETTER,
    PATTERN_CONTAINED,
    SIGNIFICANT,
)
from calibrations.discovery.outliers import told
from calibrations.discovery.patterns import Pattern, at_attitudes, one_sided, patterns, per_channel
from calibrations.discovery.plausibility import UNEXPLAINED, Finding
from calibrations.discovery.significance import Screen, Search
from calibrations.fitting.fit import Fit
from calibrations.means.noise import correlation_known, rms
from calibrations.table import Array

FINALISTS = 6  # patterns that are sharpened
NAMED = 6  # poses that are told one by one


def structure_of(fit: Fit) -> Pattern | None:
    """The plainest pattern in a fit's residual; None where there is none beyond noise."""
    screen, noise = Screen(without_slow(fit)), _patternless(fit)
    every = patterns(fit.table, fit.channels)
    found = _significant(every, Screen(fit)) or ([p for p in every if p.slow] if noise else [])
    found = sorted(found, key=lambda p: worth(p, screen), reverse=True)[:FINALISTS]
    sharp = [sharpened(pattern, screen) for pattern in (*found, *_out(fit))]
    sharp = [p for p in sharp if not (p.slow and noise) or _share_left(p, screen) < MOST_UNDER_SLOW_PATTERN]
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
    if fit.table.type.moving or not 0 < len(rows) <= max(1, MOST_ROWS_STAND_OUT * n):
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


def unexplained_scatter(fit: Fit) -> Finding | None:
    """Scatter of a fit that neither its samples' noise nor a pattern explains; None where there is none."""
    if _patternless(fit) is None or (found := structure_of(fit)) is None or found.columns.size:
        return None
    return Finding(UNEXPLAINED, found.text)


def _fewest_samples(fit: Fit) -> float:
    """Noise of a mean over the noise floor where all its samples are one: more they cannot be correlated."""
    return float(np.sqrt(np.median(fit.table.optional("n", 1.0))))


def _patternless(fit: Fit) -> Pattern | None:
    """More noise than a sensor makes by itself. On positions it is how well a hand repeats them, and no effect."""
    excess = rms(fit.rmse / np.hypot(fit.noise.floor, fit.noise.known_slow))
    if fit.table.type.magnitude or not fit.noise.known or excess <= MOST_SLOW_NOISE:
        return None
    slow, scatter = (float(np.max(noise / fit.noise.floor)) for noise in (fit.noise.slow, fit.noise.scatter))
    if scatter > slow and not correlation_known(fit.table) and scatter <= MOST_SLOW_NOISE * _fewest_samples(fit):
        return None  # the means may be of so few independent samples
    what = "slow drift" if slow > scatter else "scatter"
    return Pattern(f"{what} without a pattern, {max(slow, scatter):.1f} x the noise floor", np.zeros((0, 0, 0)))


def poorly_predicted(fit: Fit) -> Pattern | None:
    """The error on unseen stretches of a motion, if it is far above the noise: effects can fit few stretches alone."""
    if not fit.table.type.moving or fit.held_out_excess <= MOST_UNSEEN:
        return None
    text = f"the error on unseen stretches is {fit.held_out_excess:.2g} times the noise floor"
    return Pattern(text, np.zeros((0, 0, 0)))


def plainer(begin: Fit, end: Fit, named: Fit | None = None) -> Pattern | None:
    """The pattern that explains what the model of `begin` misses better than the effects added up to `end`.

    Both are compared by likelihood under the noise without its slow part, which would take up either; a parameter
    costs log(rows), and so does the choice among the patterns. In a motion, whose rows repeat each other, a step at the
    beginning is an effect that is always there: only an offset at one attitude competes, where it leaves noise: of few
    attitudes it takes up part of most effects. `named`: the effects without free forms, which follow any pattern and
    tell nothing of its cause.
    """
    if end is begin:
        return None
    start = without_slow(begin)
    screen = Screen(start)
    price = float(np.log(start.residual.size))
    every = patterns(start.table, start.channels)
    if start.table.type.moving:
        every = [p for p in at_attitudes(start.table, start.channels) if _leaves_noise(p, screen)]
    tried = [(worth(p, screen) - price, p) for p in every]
    best, pattern = max(tried, key=lambda each: each[0], default=(-np.inf, None))
    if (
        pattern is None
        or not best > _by_effects(end, start) + PATTERN_BETTER
        or _contains(pattern, begin, named or end, screen)
    ):
        return None
    return sharpened(pattern, screen)


def _leaves_noise(pattern: Pattern, screen: Screen) -> bool:
    """Whether what a pattern leaves is no more than noise."""
    basis = screen.basis(pattern.columns)
    left = float(screen.residual @ screen.residual) - screen.statistic(basis)
    return bool(left <= MATERIAL**2 * max(screen.free - basis.shape[1], 1))


def _contains(pattern: Pattern, begin: Fit, end: Fit, screen: Screen) -> bool:
    """Whether what the effects explain is part of the pattern: it then tells more of their form, and no other cause."""
    explained = screen.freed(begin.residual - end.residual)
    inside = screen.basis(pattern.columns).T @ explained
    return float(inside @ inside) > PATTERN_CONTAINED * float(explained @ explained)


def _by_effects(end: Fit, start: Fit) -> float:
    white = start.noise.whiten(end.residual[:, :, None])[:, 0]
    return likelihood(float(white @ white), len(end.theta) - len(start.theta), start)
