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
from typing import TypeVar

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
from calibrations.fitting.problem_kinds import make_problem
from calibrations.geometry.sphere import magnetometer_coverage_warning
from calibrations.means.noise import rms
from calibrations.model.parameters import Layout
from calibrations.table import Array

C = TypeVar("C", bound=Candidate)
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


def candidates(base: Fit, effects: Mapping[str, Effect]) -> list[RowCandidate]:
    """All candidates, best first: by likelihood, minus log(rows) for each parameter (Schwarz). Those that do not lower
    the error on unseen poses are last."""
    screen = Screen(base)
    linearised = [(effect, *_columns(screen, effect)) for effect in testable_effects(base, effects)]
    linearised = [item for item in linearised if item[3].shape[1]]
    search = Search(screen, [basis for *_, basis in linearised])
    extras = [columns for *_, columns, _ in linearised]
    joint_gains = _gains(base, extras)
    smooth_gains = _gains(base, extras, base.problem.smooth) if base.problem.smooth.size else joint_gains
    ranked = [
        _candidate(screen, *item, gain, smooth_gain, search.trials)
        for item, gain, smooth_gain in zip(linearised, joint_gains, smooth_gains, strict=True)
    ]
    unseen = base.held_out_excess
    ranked = _with_probabilities(ranked, base.residual.size, unseen)
    ranked.sort(
        key=lambda c: (c.held_out_after < unseen, round(schwarz(c, base.residual.size), DECIMALS)), reverse=True
    )
    rivals = [_find_same_signals(c, ranked, screen) for c in ranked]
    return [
        replace(c, indistinguishable_from=(*names, *_find_unlogged_effects(c.effect, base, effects)))
        for c, names in zip(ranked, rivals, strict=True)
    ]


def best_pair(base: Fit, ranked: list[RowCandidate]) -> tuple[RowCandidate, RowCandidate] | None:
    """The two candidates with the largest joint gain, the stronger first; None if no pair is significant.

    A model may miss two effects of which neither is visible while the other one is missing.
    """
    pairs = [(a, b) for a, b in combinations(ranked, 2) if _fits(base, a.effect, b.effect)]
    joint = _gains(base, [np.concatenate([a.columns, b.columns], axis=2) for a, b in pairs], base.problem.smooth)
    best, lowest_p = None, 1.0
    for (a, b), gain in zip(pairs, joint, strict=True):
        rank = a.rank + b.rank
        free = base.residual.size - base.jacobian.shape[2] - rank - base.problem.smooth.size
        p = chance_of_gain(gain, base.residual.size, rank, max(free, 1)) * len(pairs)
        if p < lowest_p:
            best, lowest_p = (a, b), p
    return best if lowest_p < SIGNIFICANT else None


def chance_of_gain(twice_gain: float, rows: int, rank: int, free: float) -> float:
    """Chance of such a gain in log-likelihood on noise.

    F rather than chi-squared: the noise's level is estimated from these rows.

    Columns that the model already spans (rank 0) prove nothing: any gain is chance. So is a loss: a fit with a penalty,
    or with another noise, can be less likely than the one before.
    """
    if rank == 0 or twice_gain <= 0:
        return 1.0
    return float(fdtrc(rank, free, np.expm1(min(twice_gain / rows, 500.0)) * free / rank))


def schwarz(c: RowCandidate, rows: int) -> float:
    """Gain minus the price of the parameters, log(rows) each."""
    return c.gain - c.rank * float(np.log(rows))


def named_first(ranked: Sequence[C], names: Sequence[str]) -> list[C]:
    """The candidates, first those with these names, in the order of the names."""
    return sorted(ranked, key=lambda c: names.index(c.name) if c.name in names else len(names))


def with_planned(ranked: Sequence[RowCandidate], steps: Sequence[Step[Fit]]) -> list[RowCandidate]:
    """The candidates, first the effects of the planned steps, the next one with the errors of its full fit.

    The next one may be a free form.
    """
    step = steps[0]
    base, extended = step.before, step.after
    planned = next((c for c in ranked if c.name == step.name), None)
    if planned is None:
        planned = _free_candidate(next(t.effect for t in extended.model.terms if t.name == step.name), base, extended)
    fitted_candidate = replace(planned, excess_after=extended.pooled_excess, held_out_after=extended.held_out_excess)
    remaining = [c for c in named_first(ranked, [s.name for s in steps]) if c.name != step.name]
    return _with_probabilities([fitted_candidate, *remaining], base.residual.size, base.held_out_excess)


def _free_candidate(effect: Effect, base: Fit, extended: Fit) -> RowCandidate:
    """A free form as a candidate, from its fit; its rank is that of all columns that it may use."""
    screen = Screen(base)
    start, columns, basis = _columns(screen, effect)
    gain, rank = twice_log_likelihood(extended) - twice_log_likelihood(base), basis.shape[1]
    free = min(base.residual.size - base.jacobian.shape[2] - rank, base.noise.freedom)
    return RowCandidate(
        effect=effect, rank=rank, gain=gain, p_value=chance_of_gain(gain, base.residual.size, rank, max(free, 1)),
        probability=0.0, excess_after=extended.pooled_excess, held_out_after=extended.held_out_excess,
        start=start, columns=columns, basis=basis,
    )  # fmt: skip


def refit_with(base: Fit, c: RowCandidate) -> Fit:
    """The model with the candidate added, all parameters fitted jointly."""
    return refit(base, base.model.with_effect(c.effect), c.start)


def testable_effects(base: Fit, effects: Mapping[str, Effect]) -> list[Effect]:
    """The effects that the model can miss and that the data can show, with enough rows for their parameters."""
    return [effect for effect in effects.values() if _applies(effect, base) and _fits(base, effect)]


def _applies(effect: Effect, base: Fit) -> bool:
    """Whether the model can miss the effect, and the data can show it.

    If the directions do not cover the sphere, iron cannot be tested, and looks like any other change from one direction
    to the next: then only effects of iron are candidates. A drift needs an offset in the model: without one, a fit uses
    a nearly constant drift as the offset.
    """
    model = base.model
    addable = set(effect.after) <= set(model.effects) and not model.holds(effect.name)
    addable = addable and (not DRIFTING & set(effect.needs) or bool(OFFSETS & set(model.effects)))
    iron_is_seen = effect.first_kind.field or magnetometer_coverage_warning(base.table) is None
    return addable and iron_is_seen and effect.excluded(base.table) is None


def _fits(base: Fit, *additions: Effect) -> bool:
    """Whether the table has more rows than the model with these effects has parameters."""
    model = base.model
    for effect in additions:
        model = model.with_effect(effect)
    return base.residual.size > len(Layout.of(model.for_table(base.table), base.table).slots)


def _columns(screen: Screen, effect: Effect) -> tuple[Array, Array, Array]:
    """The best start, derivatives of the residual with respect to the effect's parameters there, and their basis."""
    base = screen.fit
    model = base.model.with_effect(effect)
    problem = make_problem(model, base.table)
    mask = problem.layout.of_effect(effect.name)
    best = (np.zeros(0), np.zeros((*base.residual.shape, 0)), np.zeros((base.residual.size, 0)))
    for theta in _starts(base, problem, effect):
        columns = problem.jacobian(theta, mask)
        if effect.searched(base.table) > 1:
            columns = np.concatenate([_contribution(base, problem, theta, mask), columns], axis=2)
        basis = screen.basis(columns)
        if not best[2].shape[1] or screen.statistic(basis) > screen.statistic(best[2]):
            best = (theta, columns, basis)
    return best


def _starts(base: Fit, problem: Problem, effect: Effect) -> list[Array]:
    """Values for the effect's derivatives: near zero, or its fit if its values were searched for in the data."""
    if effect.searched(base.table) > 1:
        return [refit(base, problem.layout.model).theta]
    return problem.layout.starts()


def _contribution(base: Fit, problem: Problem, theta: Array, mask: NDArray[np.bool_]) -> Array:
    """Change of the residual by the effect, shape (channels, n, 1)."""
    return (base.problem.residual(theta[~mask]) - problem.residual(theta))[:, :, None]


def _gains(base: Fit, extras: list[Array], smooth: Array | None = None) -> list[float]:
    """Twice the gain in log-likelihood by each block of columns, with the noise refitted and `smooth` eliminated."""
    scaled = [e / np.maximum(np.sqrt(np.sum(e**2, axis=(0, 1))), np.finfo(float).tiny) for e in extras]
    no_columns = np.zeros((base.table.n, 0))
    return gains(base.noise, base.residual, base.jacobian, scaled, no_columns if smooth is None else smooth)


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
    base, rank = screen.fit, basis.shape[1]
    smooth = base.problem.smooth.shape[1]
    score = screen.statistic(basis)
    free = min(base.residual.size - base.jacobian.shape[2] - rank - smooth * len(base.channels), base.noise.freedom)
    p_score = float(fdtrc(rank, free, score / rank)) if smooth else 1.0
    p_refitted = chance_of_gain(smooth_gain, base.residual.size, rank, free)
    tests, searched = 2 if smooth else 1, effect.searched(base.table)
    remainder = base.residual - np.concatenate([base.jacobian, columns], axis=2) @ _change(base, columns)
    return RowCandidate(
        effect=effect,
        rank=rank,
        gain=twice_gain - 2 * float(np.log(searched)),
        p_value=float(of_search(min(p_score, p_refitted), tests * trials * searched)),
        excess_after=float(np.sqrt(np.mean((rms(remainder) / base.noise.floor) ** 2))),
        held_out_after=base.held_out_with(columns),
        probability=0.0,
        start=start,
        columns=columns,
        basis=basis,
    )


def _change(base: Fit, columns: Array) -> Array:
    """Least-squares change of all parameters, the candidate's at the end, to first order."""
    white = np.hstack([base.whitened[:, 1:], base.noise.whiten(columns)])
    size = np.linalg.norm(white, axis=0)
    size = np.where(size > 0, size, 1.0)
    return np.asarray(np.linalg.lstsq(white / size, base.whitened[:, 0], rcond=1e-9)[0] / size)


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


def _find_unlogged_effects(effect: Effect, base: Fit, effects: Mapping[str, Effect]) -> tuple[str, ...]:
    """Effects of temperature that the table cannot separate from an effect of time, because it has no temperature."""
    if "t_s" not in effect.needs or not base.table.type.stage_angles:
        return ()
    return tuple(
        name
        for name, rival in effects.items()
        if name in effect.confused_with and "temperature_c" in rival.needs and "temperature_c" not in base.table
    )


def _find_same_signals(c: RowCandidate, ranked: list[RowCandidate], screen: Screen) -> tuple[str, ...]:
    """Candidates that explain nearly all of the signal of `c`, with at most one parameter more."""
    signal = c.basis @ (c.basis.T @ screen.residual)
    strength = float(signal @ signal)
    if strength < 2 * INSEPARABLE:
        return ()
    names = []
    for rival in ranked:
        unexplained = strength - float(np.sum((rival.basis.T @ signal) ** 2))
        if rival is not c and unexplained < INSEPARABLE and rival.rank <= c.rank + 1:
            names.append(rival.name)
    return tuple(names)


def with_rivals(best: RowCandidate, ranked: Sequence[RowCandidate], base: Fit) -> RowCandidate:
    """`best`, one of the candidates `ranked` on top of `base`, with all its rivals."""
    if best.p_value >= SIGNIFICANT:
        return best
    by_name = {c.name: c for c in ranked}
    inseparable = [
        name
        for name in best.indistinguishable_from
        if name not in by_name or _has_undetermined_part(by_name[name], best, base)
    ]
    similar = [c for c in ranked if c.name not in (best.name, *best.indistinguishable_from) and _is_similar(c, best)]
    likelihood = twice_log_likelihood(refit_with(base, best)) if similar else 0.0
    further = [c.name for c in similar if _is_rival(refit_with(base, c), base, likelihood)]
    return replace(best, indistinguishable_from=(*inseparable, *further))


def _has_undetermined_part(c: RowCandidate, best: RowCandidate, base: Fit) -> bool:
    """Whether the data leave a part of a rival that contains `best` undetermined, so that it is a rival still.

    A play of width 0 is no rival; without a reversal, a play may have any width.
    """
    if best.name not in c.effect.contains:
        return True
    return not all(e.identified for e in refit_with(base, c).model.estimates(c.name))


def _is_similar(c: RowCandidate, best: RowCandidate) -> bool:
    """Whether `c` explains nearly as much with at most one parameter more, and neither effect contains the other."""
    nested = best.name in c.effect.contains or c.name in best.effect.contains
    return not nested and c.rank <= best.rank + 1 and c.gain > SAME_SHAPE * best.gain


def _is_rival(extended: Fit, base: Fit, likeliest: float) -> bool:
    """Whether the fit `extended` is as good as that of the effect with twice the log-likelihood `likeliest`."""
    if likeliest - twice_log_likelihood(extended) < INSEPARABLE:
        return True
    as_good = extended.pooled_excess <= MATERIAL and extended.share_left(base) <= MOST_BY_FORM
    return as_good and not extended.table.type.moving
