"""The structure of a residual, in words: the best pattern, the outlying poses, or more noise than a sensor has.

The fitted noise decides which patterns are significant. The likelihood under the noise without its slow part compares
them, because slow noise would absorb steps and ramps. The best few are sharpened first: the row of a step, the width of
a sector, one side or both. Outlying poses compete with them; each pose and the choice of it has a price.

Patterns compete with effects as well: a step in time looks like a drift to a catalogue without steps. A pattern that
describes the residual better than all effects found means that the cause is not in the catalogue.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc, gammaln, ndtri

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
from calibrations.discovery.outliers import outlier_text
from calibrations.discovery.patterns import Pattern, at_attitudes, one_sided, patterns, per_channel
from calibrations.discovery.significance import Screen, Search, of_search
from calibrations.discovery.verdict import Finding, Verdict
from calibrations.fitting.fit import Fit
from calibrations.fitting.noise_fit import gains
from calibrations.fitting.solution import repeats_few_poses
from calibrations.means.noise import correlation_known, most_scatter, rms, robust_std
from calibrations.table import Array

FINALISTS = 6  # patterns that are sharpened
NAMED = 6  # poses that the text lists one by one


def structure_of(fit: Fit) -> Pattern | None:
    """The best pattern in a fit's residual; None if the residual is noise."""
    screen, noise = Screen(without_slow(fit)), _excess_noise(fit)
    all_patterns = _by_score(patterns(fit.table, fit.channels), screen)
    significant = _significant(all_patterns, Screen(fit))
    if all(p.slow and not p.sudden for p in significant):  # the fitted noise may contain a step
        significant = [*_significant_in_other_noise(all_patterns, fit), *significant]
    if not significant and noise:
        significant = [p for p in all_patterns if p.slow]
    finalists = [sharpen(pattern, screen) for pattern in (*significant[:FINALISTS], *_outlier_pattern(fit))]
    finalists = [
        p for p in finalists if not (p.slow and noise) or _remaining_share(p, screen) < MOST_UNDER_SLOW_PATTERN
    ]
    return max(finalists, key=lambda p: score(p, screen), default=noise)


def _remaining_share(pattern: Pattern, screen: Screen) -> float:
    """Share of the residual's excess over white noise that remains with the pattern; of slow noise much remains."""
    fit, columns = screen.fit, pattern.columns.reshape(screen.fit.residual.size, -1)
    J = np.hstack([fit.jacobian.reshape(fit.residual.size, -1), columns])
    size = np.linalg.norm(J, axis=0)
    J = J / np.where(size > 0, size, 1.0)
    r = fit.residual.ravel()
    remainder = (r - J @ np.linalg.lstsq(J, r, rcond=1e-9)[0]).reshape(fit.residual.shape)
    remaining_square = float(np.mean((rms(remainder) / fit.noise.floor) ** 2))
    return max(remaining_square - 1, 0.0) / max(fit.pooled_excess**2 - 1, 1e-9)


def without_slow(fit: Fit) -> Fit:
    """The fit with noise that has no slow part."""
    return replace(fit, noise=replace(fit.noise, ratio=np.zeros_like(fit.noise.ratio)))


def score(pattern: Pattern, screen: Screen) -> float:
    """Twice the log-likelihood with the pattern, minus the price of its parameters, up to a constant."""
    return _scores([pattern], screen)[0]


def _scores(all_patterns: Sequence[Pattern], screen: Screen) -> list[float]:
    """The score of each pattern."""
    residual_squares = float(screen.residual @ screen.residual)
    bases = screen.bases([p.columns for p in all_patterns])
    squares = [residual_squares - screen.statistic(basis) for basis in bases]
    return [
        likelihood(left, basis.shape[1], screen.fit) - p.price
        for left, basis, p in zip(squares, bases, all_patterns, strict=True)
    ]


def _by_score(all_patterns: Sequence[Pattern], screen: Screen) -> list[Pattern]:
    """The patterns, best first."""
    scores = _scores(all_patterns, screen)
    return [all_patterns[i] for i in sorted(range(len(scores)), key=lambda i: scores[i], reverse=True)]


def likelihood(squares: float, parameters: float, fit: Fit) -> float:
    """Twice the log-likelihood of a sum of whitened squares, minus log(rows) for each parameter (Schwarz)."""
    rows = fit.residual.size
    return -rows * float(np.log(max(squares, 1e-300) / rows)) - parameters * float(np.log(rows))


def _significant(all_patterns: list[Pattern], screen: Screen) -> list[Pattern]:
    """The patterns that are significant against noise alone."""
    tested = list(zip(all_patterns, screen.bases([p.columns for p in all_patterns]), strict=True))
    tested = [(p, basis) for p, basis in tested if basis.shape[1]]
    chances = Search(screen, [basis for _, basis in tested]).p_values
    return [p for (p, _), chance in zip(tested, chances, strict=True) if chance < SIGNIFICANT]


def _significant_in_other_noise(ranked: list[Pattern], fit: Fit) -> list[Pattern]:
    """The best patterns that are significant when the noise is fitted again beside each.

    The noise that is fitted without a pattern contains it, so that one step makes a random walk of it. A trend, a ramp
    or an oscillation is left out, because slow noise has such parts. A motion has too few stretches for this.
    """
    if fit.table.type.moving:
        return []
    rows, significant = fit.residual.size, []
    finalists = [p for p in ranked if p.sudden or not p.slow][:FINALISTS]
    gains_by_pattern = gains(
        fit.noise, fit.residual, fit.jacobian, [p.columns for p in finalists], np.zeros((fit.table.n, 0))
    )
    for pattern, gain in zip(finalists, gains_by_pattern, strict=True):
        k = pattern.columns.shape[2]
        free = max(rows - len(fit.theta) - k, 1)
        F = np.expm1(gain / rows) * free / k
        if of_search(float(fdtrc(k, free, F)), len(ranked)) < SIGNIFICANT:
            significant.append(pattern)
    return significant


def sharpen(pattern: Pattern, screen: Screen) -> Pattern:
    """The best of the pattern and the finer ones up to its neighbours, for both directions of turning or for one."""
    table, channels = screen.fit.table, len(screen.fit.channels)
    neighbours = [pattern, *(per_channel(p, channels) for p in pattern.finer() if np.ptp(p.columns) > 0)]
    best = neighbours[int(np.argmax(screen.reductions([p.columns for p in neighbours])))]
    return max([best, *one_sided(best, table)], key=lambda p: score(p, screen))


def _outlier_pattern(fit: Fit) -> list[Pattern]:
    """The outlying poses, as one pattern; empty if there are none, or too many."""
    rows, n = find_outlying_rows(fit.residual, np.hypot(fit.noise.floor, fit.noise.wander)), fit.table.n
    if fit.table.type.moving or not 0 < len(rows) <= max(1, MOST_ROWS_STAND_OUT * n):
        return []
    columns = per_channel(Pattern("", np.eye(n)[:, rows]), len(fit.channels)).columns
    choices = gammaln(n + 1) - gammaln(len(rows) + 1) - gammaln(n - len(rows) + 1)
    numbers = tuple(map(int, fit.table.numbered(rows)))
    return [Pattern(outlier_text(numbers, fit.table.kind, NAMED), columns, price=2 * float(choices), poses=numbers)]


def find_outlying_rows(residual: Array, noise: Array) -> NDArray[np.intp]:
    """Rows whose residual (channels, n) is too large for noise with the spread of the other rows, by medians.

    The spread is at least `noise` (channels,), white and slow together: medians of slow noise are uncertain.
    """
    middle = np.median(residual, axis=1, keepdims=True)
    spread = np.maximum(robust_std(residual - middle, axis=1), noise)[:, None]
    limit = -ndtri(SIGNIFICANT / 2 / residual.size)
    return np.flatnonzero(np.any(np.abs(residual - middle) > limit * spread, axis=0))


def find_unexplained_scatter(fit: Fit) -> Finding | None:
    """Scatter of a fit that neither the samples' noise nor a pattern explains; None if there is none."""
    if _excess_noise(fit) is None or (pattern := structure_of(fit)) is None or pattern.columns.size:
        return None
    return Finding(Verdict.UNEXPLAINED, pattern.text)


def _excess_noise(fit: Fit) -> Pattern | None:
    """Noise above that of any sensor, as a pattern. On positions it is the repeatability of the hand, and no effect."""
    excess = rms(fit.rmse / np.hypot(fit.noise.floor, fit.noise.known_slow))
    if fit.table.type.magnitude or not fit.noise.known or excess <= MOST_SLOW_NOISE:
        return None
    slow, scatter = (float(np.max(noise / fit.noise.floor)) for noise in (fit.noise.slow, fit.noise.scatter))
    if scatter > slow and not correlation_known(fit.table) and scatter <= MOST_SLOW_NOISE * most_scatter(fit.table):
        return None
    noise_name = "slow drift" if slow > scatter else "scatter"
    return Pattern(f"{noise_name} without a pattern, {max(slow, scatter):.1f} x the noise floor", np.zeros((0, 0, 0)))


def poorly_predicted(fit: Fit) -> Pattern | None:
    """The error on unseen stretches of a motion, or on unseen poses, where the model follows the rows of its fit alone.

    Effects can fit each of a few stretches alone. Of poses, the generalised cross-validation has to show it as well: a
    large error on unseen poses may be that of one pose, which alone determines a parameter. Where a few poses were
    visited many times, this cross-validation over rows leaves out no pose.
    """
    seen = max(fit.pooled_excess, 1.0)
    few = fit.table.type.stage_angles and repeats_few_poses(fit.table)
    if fit.table.type.moving and fit.held_out_excess > MOST_UNSEEN:
        rows = "stretches"
    elif (
        fit.table.type.stage_angles
        and fit.held_out_excess > MOST_UNSEEN * seen
        and (few or fit.cross_validated_excess > MATERIAL * seen)
    ):
        rows = "poses"
    else:
        return None
    advice = "; these rows are at few poses: measure at more orientations" if few else ""
    text = f"the error on unseen {rows} is {fit.held_out_excess:.2g} times the noise floor{advice}"
    return Pattern(text, np.zeros((0, 0, 0)))


def find_competing_pattern(start: Fit, end: Fit, named_fit: Fit | None = None) -> Pattern | None:
    """The pattern that explains the residual of `start` better than the effects added up to `end`; None if none does.

    The likelihood under the noise without its slow part compares the two, because slow noise would absorb either. A
    parameter costs log(rows), and so does the choice among the patterns. The rows of a motion repeat each other, so
    that a step at its beginning is an effect that is always there. There, only an offset at one attitude competes, and
    only if its residual is noise: with few attitudes it absorbs a part of most effects. `named_fit`: the fit without
    free forms, which follow any pattern and do not show its cause.
    """
    if end is start:
        return None
    white_start = without_slow(start)
    screen = Screen(white_start)
    price = float(np.log(white_start.residual.size))
    all_patterns = patterns(white_start.table, white_start.channels)
    if white_start.table.type.moving:
        all_patterns = [p for p in at_attitudes(white_start.table, white_start.channels) if _leaves_noise(p, screen)]
    pattern = next(iter(_by_score(all_patterns, screen)), None)
    if (
        pattern is None
        or not score(pattern, screen) - price > _likelihood_with_effects(end, white_start) + PATTERN_BETTER
        or _contains(pattern, start, named_fit or end, screen)
    ):
        return None
    return sharpen(pattern, screen)


def _leaves_noise(pattern: Pattern, screen: Screen) -> bool:
    """Whether the residual with the pattern is noise."""
    basis = screen.basis(pattern.columns)
    squares = float(screen.residual @ screen.residual) - screen.statistic(basis)
    return bool(squares <= MATERIAL**2 * max(screen.free - basis.shape[1], 1))


def _contains(pattern: Pattern, start: Fit, end: Fit, screen: Screen) -> bool:
    """Whether the signal of the effects is part of the pattern, which then describes their form and no other cause."""
    explained = screen.freed(start.residual - end.residual)
    explained_by_pattern = screen.basis(pattern.columns).T @ explained
    return float(explained_by_pattern @ explained_by_pattern) > PATTERN_CONTAINED * float(explained @ explained)


def _likelihood_with_effects(end: Fit, white_start: Fit) -> float:
    white = white_start.noise.whiten(end.residual[:, :, None])[:, 0]
    return likelihood(float(white @ white), end.effective_parameters - len(white_start.theta), white_start)
