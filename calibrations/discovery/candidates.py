"""Every effect of the catalogue that a table can excite, as a candidate on top of a fitted model.

The gain of a candidate is that of a joint fit with the model and the noise: it counts only what slow noise does not
explain. The fit is of first order about the present one; the search refits the best candidates in full.

A rival of a candidate is as likely, or its residual is noise as well: the form of an effect and the column that drives
it are known only approximately, so that a slightly better fit proves nothing. In a motion, whose rows repeat each
other, it does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from calibrations.criteria import INSEPARABLE, MATERIAL, MOST_BY_FORM, SAME_SHAPE, SIGNIFICANT
from calibrations.discovery.findings import Candidate, Step
from calibrations.discovery.significance import Screen, Search, of_search, twice_log_likelihood
from calibrations.effects import Effect
from calibrations.fitting.fit import Fit, refit
from calibrations.fitting.noise_fit import gains
from calibrations.fitting.problem import Problem
from calibrations.geometry.sphere import magnetometer_coverage_warning
from calibrations.means.noise import rms
from calibrations.model.parameters import Layout
from calibrations.table import Array

OFFSETS = {"bias", "hard-iron", "gyro-bias"}
DRIFTING = {"t_s", "temperature_c"}  # columns that drive the drift of an offset
DECIMALS = 3  # decimals of twice the log-likelihood: less is rounding, and the catalogue's order counts


@dataclass(frozen=True, kw_only=True)
class RowCandidate(Candidate):
    """A candidate on rows. `rank`: parameters that it adds; the arrays are those of its first-order fit."""

    rank: int
    start: Array
    columns: Array
    basis: Array


def candidates(before: Fit, effects: Mapping[str, Effect]) -> list[RowCandidate]:
    """All candidates, best first: by likelihood, minus log(rows) for each parameter (Schwarz). Those that do not lower
    the error on unseen poses are last."""
    screen = Screen(before)
    linearised = [(effect, *_columns(screen, effect)) for effect in testable_effects(before, effects)]
    linearised = [item for item in linearised if item[3].shape[1]]
    search = Search(screen, [basis for *_, basis in linearised])
    extras = [columns for *_, columns, _ in linearised]
    joint_gains = _gains(before, extras)
    smooth_gains = _gains(before, extras, before.problem.smooth) if before.problem.smooth.size else joint_gains
    ranked = [
        _candidate(screen, *item, gain, smooth_gain, search.trials)
        for item, gain, smooth_gain in zip(linearised, joint_gains, smooth_gains, strict=True)
    ]
    unseen = before.held_out_excess
    ranked = _with_probabilities(ranked, before.residual.size, unseen)
    ranked.sort(
        key=lambda c: (c.held_out_after < unseen, round(schwarz(c, before.residual.size), DECIMALS)), reverse=True
    )
    rivals = [_same_signal(c, ranked, screen) for c in ranked]
    return [
        replace(c, indistinguishable_from=(*names, *_unlogged(c.effect, before, effects)))
        for c, names in zip(ranked, rivals, strict=True)
    ]


def best_pair(before: Fit, ranked: list[RowCandidate]) -> tuple[RowCandidate, RowCandidate] | None:
    """The two candidates with the largest joint gain, the stronger first; None if no pair is significant.

    A model may miss two effects of which neither is visible while the other one is missing.
    """
    pairs = [(a, b) for a, b in combinations(ranked, 2) if _fits(before, a.effect, b.effect)]
    joint = _gains(before, [np.concatenate([a.columns, b.columns], axis=2) for a, b in pairs], before.problem.smooth)
    best, lowest_p = None, 1.0
    for (a, b), gain in zip(pairs, joint, strict=True):
        rank = a.rank + b.rank
        free = before.residual.size - before.jacobian.shape[2] - rank - before.problem.smooth.size
        p = _tail(gain, before.residual.size, rank, max(free, 1)) * len(pairs)
        if p < lowest_p:
            best, lowest_p = (a, b), p
    return best if lowest_p < SIGNIFICANT else None


def _tail(twice_gain: float, rows: int, rank: int, free: float) -> float:
    """Chance of such a gain on noise. F rather than chi-squared: the noise's level is estimated from these rows.

    Columns that the model already spans (rank 0) prove nothing: any gain is chance.
    """
    if rank == 0:
        return 1.0
    return float(fdtrc(rank, free, np.expm1(min(twice_gain / rows, 500.0)) * free / rank))


def schwarz(c: RowCandidate, rows: int) -> float:
    """Gain minus the price of the parameters, log(rows) each."""
    return c.gain - c.rank * float(np.log(rows))


def with_planned(ranked: Sequence[RowCandidate], step: Step[Fit]) -> list[RowCandidate]:
    """The candidates, first the effect of a planned step with the errors of its full fit. It may be a free form."""
    before, after = step.before, step.after
    planned = next((c for c in ranked if c.name == step.name), None)
    if planned is None:
        planned = _free_candidate(next(t.effect for t in after.model.terms if t.name == step.name), before, after)
    full = replace(planned, excess_after=after.pooled_excess, held_out_after=after.held_out_excess)
    remaining = [c for c in ranked if c.name != step.name]
    return _with_probabilities([full, *remaining], before.residual.size, before.held_out_excess)


def _free_candidate(effect: Effect, before: Fit, after: Fit) -> RowCandidate:
    """A free form as a candidate, from its fit; its rank is that of all columns that it may use."""
    screen = Screen(before)
    start, columns, basis = _columns(screen, effect)
    gain, rank = twice_log_likelihood(after) - twice_log_likelihood(before), basis.shape[1]
    free = min(before.residual.size - before.jacobian.shape[2] - rank, before.noise.freedom)
    return RowCandidate(
        effect=effect, rank=rank, gain=gain, p_value=_tail(gain, before.residual.size, rank, max(free, 1)),
        probability=0.0, excess_after=after.pooled_excess, held_out_after=after.held_out_excess,
        start=start, columns=columns, basis=basis,
    )  # fmt: skip


def added(before: Fit, c: RowCandidate) -> Fit:
    """The model with the candidate added, all parameters fitted jointly."""
    return refit(before, before.model.with_effect(c.effect), c.start)


def testable_effects(before: Fit, effects: Mapping[str, Effect]) -> list[Effect]:
    """The effects that the model can miss and that the data can show, with enough rows for their parameters."""
    return [effect for effect in effects.values() if _applies(effect, before) and _fits(before, effect)]


def _applies(effect: Effect, before: Fit) -> bool:
    """Whether the model can miss the effect, and the data can show it.

    If the directions do not cover the sphere, iron cannot be tested, and looks like any other change from one direction
    to the next: then only effects of iron are candidates. A drift needs an offset in the model: without one, a fit uses
    a nearly constant drift as the offset.
    """
    model = before.model
    known = set(effect.after) <= set(model.effects) and not model.holds(effect.name)
    known = known and (not DRIFTING & set(effect.needs) or bool(OFFSETS & set(model.effects)))
    iron_is_seen = effect.first_kind.field or magnetometer_coverage_warning(before.table) is None
    return known and iron_is_seen and effect.excluded(before.table) is None


def _fits(before: Fit, *added: Effect) -> bool:
    """Whether the table has more rows than the model with these effects has parameters."""
    model = before.model
    for effect in added:
        model = model.with_effect(effect)
    return before.residual.size > len(Layout.of(model.for_table(before.table), before.table).slots)


def _columns(screen: Screen, effect: Effect) -> tuple[Array, Array, Array]:
    """The best start, derivatives of the residual with respect to the effect's parameters there, and their basis."""
    before = screen.fit
    model = before.model.with_effect(effect)
    problem = Problem.of(model, before.table)
    mask = problem.layout.of_effect(effect.name)
    best = (np.zeros(0), np.zeros((*before.residual.shape, 0)), np.zeros((before.residual.size, 0)))
    for theta in _starts(before, problem, effect):
        columns = problem.jacobian(theta, mask)
        if effect.searched(before.table) > 1:
            columns = np.concatenate([_contribution(before, problem, theta, mask), columns], axis=2)
        basis = screen.basis(columns)
        if not best[2].shape[1] or screen.statistic(basis) > screen.statistic(best[2]):
            best = (theta, columns, basis)
    return best


def _starts(before: Fit, problem: Problem, effect: Effect) -> list[Array]:
    """Values for the effect's derivatives: near zero, or its fit if its values were searched for in the data."""
    if effect.searched(before.table) > 1:
        return [refit(before, problem.layout.model).theta]
    return problem.layout.starts()


def _contribution(before: Fit, problem: Problem, theta: Array, mask: NDArray[np.bool_]) -> Array:
    """Change of the residual by the effect, shape (channels, n, 1)."""
    return (before.problem.residual(theta[~mask]) - problem.residual(theta))[:, :, None]


def _gains(before: Fit, extras: list[Array], smooth: Array | None = None) -> list[float]:
    """Twice the gain in log-likelihood by each block of columns, with the noise refitted and `smooth` eliminated."""
    scaled = [e / np.maximum(np.sqrt(np.sum(e**2, axis=(0, 1))), np.finfo(float).tiny) for e in extras]
    nothing = np.zeros((before.table.n, 0))
    return gains(before.noise, before.residual, before.jacobian, scaled, nothing if smooth is None else smooth)


def _candidate(
    screen: Screen,
    effect: Effect,
    start: Array,
    columns: Array,
    basis: Array,
    twice_gain: float,
    smooth_gain: float,
    trials: float,
) -> RowCandidate:
    """`twice_gain`: twice the gain in log-likelihood; `smooth_gain`: the same with the smooth columns eliminated.

    A signal that repeats with the angles counts as slow noise in neither test: one eliminates it, one keeps the noise.
    """
    before, rank = screen.fit, basis.shape[1]
    smooth = before.problem.smooth.shape[1]
    score = screen.statistic(basis)
    free = min(
        before.residual.size - before.jacobian.shape[2] - rank - smooth * len(before.channels), before.noise.freedom
    )
    p_score = float(fdtrc(rank, free, score / rank)) if smooth else 1.0
    p_refitted = _tail(smooth_gain, before.residual.size, rank, free)
    tests, searched = 2 if smooth else 1, effect.searched(before.table)
    after = before.residual - np.concatenate([before.jacobian, columns], axis=2) @ _change(before, columns)
    return RowCandidate(
        effect=effect,
        rank=rank,
        gain=twice_gain - 2 * float(np.log(searched)),
        p_value=float(of_search(min(p_score, p_refitted), tests * trials * searched)),
        excess_after=float(np.sqrt(np.mean((rms(after) / before.noise.floor) ** 2))),
        held_out_after=before.held_out_with(columns),
        probability=0.0,
        start=start,
        columns=columns,
        basis=basis,
    )


def _change(before: Fit, columns: Array) -> Array:
    """Least-squares change of all parameters, the candidate's at the end, to first order."""
    white = np.hstack([before.whitened[:, 1:], before.noise.whiten(columns)])
    size = np.linalg.norm(white, axis=0)
    size = np.where(size > 0, size, 1.0)
    return np.asarray(np.linalg.lstsq(white / size, before.whitened[:, 0], rcond=1e-9)[0] / size)


def _with_probabilities(ranked: list[RowCandidate], rows: int, unseen: float) -> list[RowCandidate]:
    """Posterior probability of each candidate, against the others and against a complete model.

    Prior: a complete model has probability 1/2, and all effects share the other half equally, because of many trials
    one always fits well (Scott and Berger, Ann. Statist. 38 (2010), 2587). A candidate that does not lower the error on
    unseen poses has probability 0.
    """
    half_scores = [schwarz(c, rows) / 2 if c.held_out_after < unseen else -np.inf for c in ranked]
    log_weights = np.array([*half_scores, np.log(max(len(ranked), 1))])
    weight = np.exp(log_weights - log_weights.max())
    return [replace(c, probability=float(w / weight.sum())) for c, w in zip(ranked, weight[:-1], strict=True)]


def _unlogged(effect: Effect, before: Fit, effects: Mapping[str, Effect]) -> tuple[str, ...]:
    """Effects of temperature that the table cannot separate from an effect of time, because it has no temperature."""
    if "t_s" not in effect.needs or not before.table.type.stage_angles:
        return ()
    return tuple(
        name
        for name, rival in effects.items()
        if name in effect.confused_with and "temperature_c" in rival.needs and "temperature_c" not in before.table
    )


def _same_signal(c: RowCandidate, ranked: list[RowCandidate], screen: Screen) -> tuple[str, ...]:
    """Candidates that explain nearly all of the signal of `c`, with at most one parameter more."""
    signal = c.basis @ (c.basis.T @ screen.residual)
    strength = float(signal @ signal)
    if strength < 2 * INSEPARABLE:
        return ()
    names = []
    for rival in ranked:
        lost = strength - float(np.sum((rival.basis.T @ signal) ** 2))
        if rival is not c and lost < INSEPARABLE and rival.rank <= c.rank + 1:
            names.append(rival.name)
    return tuple(names)


def with_rivals(best: RowCandidate, ranked: Sequence[RowCandidate], before: Fit) -> RowCandidate:
    """`best`, one of the candidates `ranked` on top of `before`, with all its rivals."""
    if best.p_value >= SIGNIFICANT:
        return best
    by_name = {c.name: c for c in ranked}
    inseparable = [
        name
        for name in best.indistinguishable_from
        if name not in by_name or _has_undetermined_part(by_name[name], best, before)
    ]
    similar = [c for c in ranked if c.name not in (best.name, *best.indistinguishable_from) and _is_similar(c, best)]
    likelihood = twice_log_likelihood(added(before, best)) if similar else 0.0
    further = [c.name for c in similar if _is_rival(added(before, c), before, likelihood)]
    return replace(best, indistinguishable_from=(*inseparable, *further))


def _has_undetermined_part(c: RowCandidate, best: RowCandidate, before: Fit) -> bool:
    """Whether the data leave a part of a rival that contains `best` undetermined, so that it is a rival still.

    A play of width 0 is no rival; without a reversal, a play may have any width.
    """
    if best.name not in c.effect.contains:
        return True
    return not all(e.identified for e in added(before, c).model.estimates(c.name))


def _is_similar(c: RowCandidate, best: RowCandidate) -> bool:
    """Whether `c` explains nearly as much with at most one parameter more, and neither effect contains the other."""
    within = best.name in c.effect.contains or c.name in best.effect.contains
    return not within and c.rank <= best.rank + 1 and c.gain > SAME_SHAPE * best.gain


def _is_rival(after: Fit, before: Fit, likeliest: float) -> bool:
    """Whether the fit `after` is as good as that of the effect with twice the log-likelihood `likeliest`."""
    if likeliest - twice_log_likelihood(after) < INSEPARABLE:
        return True
    as_good = after.pooled_excess <= MATERIAL and after.share_left(before) <= MOST_BY_FORM
    return as_good and not after.table.type.moving
