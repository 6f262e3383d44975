"""Every effect of the catalogue that a table can excite, tried on top of a fitted model.

Each is judged jointly with the model and with the noise fitted anew: a candidate may win only what slow noise does not
already take up. First order about the present fit; the best are then refitted in full.

A rival of a candidate is as likely, or leaves a residual as small as noise: the form in which an effect acts is known
only approximately, and so is the column that it depends on. A fit that is slightly better is then no proof. In a
motion, whose rows repeat each other, it is one.
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
DRIFTING = {"t_s", "temperature_c"}  # what an effect goes by that lets an offset drift
SAME = 3  # decimals of twice the log-likelihood: less is rounding, and the catalogue's order counts


@dataclass(frozen=True, kw_only=True)
class RowCandidate(Candidate):
    """A candidate on rows. `rank`: parameters that it adds; the arrays are those of its first-order fit."""

    rank: int
    start: Array
    columns: Array
    basis: Array


def candidates(before: Fit, effects: Mapping[str, Effect]) -> list[RowCandidate]:
    """All candidates, best first: by likelihood, a parameter costing log(rows) (Schwarz); those that do not lower
    the error on unseen poses come last."""
    screen = Screen(before)
    tried = [(effect, *_columns(screen, effect)) for effect in askable(before, effects)]
    tried = [each for each in tried if each[3].shape[1]]
    search = Search(screen, [basis for *_, basis in tried])
    extras = [columns for *_, columns, _ in tried]
    worth = _gains(before, extras)
    besides = _gains(before, extras, before.problem.smooth) if before.problem.smooth.size else worth
    found = [
        _judge(screen, *each, gain, beside, search.trials)
        for each, gain, beside in zip(tried, worth, besides, strict=True)
    ]
    unseen = before.held_out_excess
    found = _with_probabilities(found, before.residual.size, unseen)
    found.sort(key=lambda c: (c.held_out_after < unseen, round(schwarz(c, before.residual.size), SAME)), reverse=True)
    like = [_like(c, found, screen) for c in found]
    return [
        replace(c, indistinguishable_from=(*names, *_unlogged(c.effect, before, effects)))
        for c, names in zip(found, like, strict=True)
    ]


def best_pair(before: Fit, found: list[RowCandidate]) -> tuple[RowCandidate, RowCandidate] | None:
    """The two candidates that gain most together, where together they are significant; the stronger first.

    A sensor may miss two effects of which neither is seen while the other is missing.
    """
    pairs = [(a, b) for a, b in combinations(found, 2) if _fits(before, a.effect, b.effect)]
    joint = _gains(before, [np.concatenate([a.columns, b.columns], axis=2) for a, b in pairs], before.problem.smooth)
    best, least = None, 1.0
    for (a, b), gain in zip(pairs, joint, strict=True):
        rank = a.rank + b.rank
        free = before.residual.size - before.jacobian.shape[2] - rank - before.problem.smooth.size
        p = _tail(gain, before.residual.size, rank, max(free, 1)) * len(pairs)
        if p < least:
            best, least = (a, b), p
    return best if least < SIGNIFICANT else None


def _tail(twice_gain: float, rows: int, rank: int, free: float) -> float:
    """Chance of such a gain on noise. F rather than chi-squared: the noise's level is estimated from these rows.

    Columns that the model could have already (rank 0) show nothing: any gain comes by chance.
    """
    if rank == 0:
        return 1.0
    return float(fdtrc(rank, free, np.expm1(min(twice_gain / rows, 500.0)) * free / rank))


def schwarz(c: RowCandidate, rows: int) -> float:
    """Gain less the price of the parameters, log(rows) each."""
    return c.gain - c.rank * float(np.log(rows))


def with_planned(found: Sequence[RowCandidate], step: Step[Fit]) -> list[RowCandidate]:
    """The candidates with the effect of a planned step first, as its full fit shows it. It may be a free form."""
    before, after = step.before, step.after
    own = next((c for c in found if c.name == step.name), None)
    if own is None:
        own = _free(next(t.effect for t in after.model.terms if t.name == step.name), before, after)
    full = replace(own, excess_after=after.pooled_excess, held_out_after=after.held_out_excess)
    others = [c for c in found if c.name != step.name]
    return _with_probabilities([full, *others], before.residual.size, before.held_out_excess)


def _free(effect: Effect, before: Fit, after: Fit) -> RowCandidate:
    """A free form as a candidate, from the fit with it; its rank is that of the columns that it could have."""
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


def askable(before: Fit, effects: Mapping[str, Effect]) -> list[Effect]:
    """The effects that the model can miss and that the data can show, with rows enough for their parameters."""
    return [effect for effect in effects.values() if _applies(effect, before) and _fits(before, effect)]


def _applies(effect: Effect, before: Fit) -> bool:
    """Whether the model can miss it, and the data can have it.

    Where iron cannot be asked for, as directions leave parts of the sphere out, it looks like anything else that
    changed from one direction to the next: nothing but iron is asked for then. And what drifts is an offset: a model
    without one would take a drift that hardly moves for it.
    """
    model = before.model
    known = set(effect.after) <= set(model.effects) and not model.holds(effect.name)
    known = known and (not DRIFTING & set(effect.needs) or bool(OFFSETS & set(model.effects)))
    askable = effect.first_kind.field or magnetometer_coverage_warning(before.table) is None
    return known and askable and effect.excluded(before.table) is None


def _fits(before: Fit, *added: Effect) -> bool:
    """Whether there are more rows than parameters with these effects."""
    model = before.model
    for effect in added:
        model = model.with_effect(effect)
    return before.residual.size > len(Layout.of(model.for_table(before.table), before.table).slots)


def _columns(screen: Screen, effect: Effect) -> tuple[Array, Array, Array]:
    """The best start, derivatives of the residual with respect to the effect's parameters there, and their basis."""
    before = screen.fit
    model = before.model.with_effect(effect)
    problem = Problem.of(model, before.table)
    mine = problem.layout.of_effect(effect.name)
    best = (np.zeros(0), np.zeros((*before.residual.shape, 0)), np.zeros((before.residual.size, 0)))
    for theta in _starts(before, problem, effect):
        columns = problem.jacobian(theta, mine)
        if effect.searched(before.table) > 1:
            columns = np.concatenate([_contribution(before, problem, theta, mine), columns], axis=2)
        basis = screen.basis(columns)
        if not best[2].shape[1] or screen.statistic(basis) > screen.statistic(best[2]):
            best = (theta, columns, basis)
    return best


def _starts(before: Fit, problem: Problem, effect: Effect) -> list[Array]:
    """Where the effect's derivatives are taken: near nothing or, where it was searched for in the data, at its fit."""
    if effect.searched(before.table) > 1:
        return [refit(before, problem.layout.model).theta]
    return problem.layout.starts()


def _contribution(before: Fit, problem: Problem, theta: Array, mine: NDArray[np.bool_]) -> Array:
    """What the effect changes of the residual, shape (channels, n, 1)."""
    return (before.problem.residual(theta[~mine]) - problem.residual(theta))[:, :, None]


def _gains(before: Fit, extras: list[Array], smooth: Array | None = None) -> list[float]:
    """Twice the gain in log-likelihood by each, the noise fitted anew with it, `smooth` columns set aside."""
    scaled = [e / np.maximum(np.sqrt(np.sum(e**2, axis=(0, 1))), np.finfo(float).tiny) for e in extras]
    nothing = np.zeros((before.table.n, 0))
    return gains(before.noise, before.residual, before.jacobian, scaled, nothing if smooth is None else smooth)


def _judge(
    screen: Screen,
    effect: Effect,
    start: Array,
    columns: Array,
    basis: Array,
    worth: float,
    beside_smooth: float,
    trials: float,
) -> RowCandidate:
    """`worth`: twice the gain in log-likelihood; `beside_smooth`: what is left of it beside the smooth columns.

    What returns with the angles passes for slow noise in neither test: it is set aside, or the noise stays as it was.
    """
    before, rank = screen.fit, basis.shape[1]
    smooth = before.problem.smooth.shape[1]
    score = screen.statistic(basis)
    free = min(
        before.residual.size - before.jacobian.shape[2] - rank - smooth * len(before.channels), before.noise.freedom
    )
    p_score = float(fdtrc(rank, free, score / rank)) if smooth else 1.0
    p_refitted = _tail(beside_smooth, before.residual.size, rank, free)
    tests, searched = 2 if smooth else 1, effect.searched(before.table)
    after = before.residual - np.concatenate([before.jacobian, columns], axis=2) @ _change(before, columns)
    return RowCandidate(
        effect=effect,
        rank=rank,
        gain=worth - 2 * float(np.log(searched)),
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


def _with_probabilities(found: list[RowCandidate], rows: int, unseen: float) -> list[RowCandidate]:
    """Posterior probability of each, against the others and against nothing missing.

    Before, that nothing is missing is as likely as that something is, and all effects are equally likely: of many that
    are tried one is always good (Scott and Berger, Ann. Statist. 38 (2010), 2587). A candidate that does not lower the
    error on unseen poses has none.
    """
    each = [schwarz(c, rows) / 2 if c.held_out_after < unseen else -np.inf for c in found]
    half = np.array([*each, np.log(max(len(found), 1))])
    weight = np.exp(half - half.max())
    return [replace(c, probability=float(w / weight.sum())) for c, w in zip(found, weight[:-1], strict=True)]


def _unlogged(effect: Effect, before: Fit, effects: Mapping[str, Effect]) -> tuple[str, ...]:
    """What an effect of time may be confused with, and the table lacks the column to tell: an unlogged temperature."""
    if "t_s" not in effect.needs or not before.table.type.stage_angles:
        return ()
    return tuple(
        name
        for name, other in effects.items()
        if name in effect.confused_with and "temperature_c" in other.needs and "temperature_c" not in before.table
    )


def _like(c: RowCandidate, others: list[RowCandidate], screen: Screen) -> tuple[str, ...]:
    """RowCandidates that would take up nearly all that `c` takes up, with at most one parameter more."""
    signal = c.basis @ (c.basis.T @ screen.residual)
    strength = float(signal @ signal)
    if strength < 2 * INSEPARABLE:
        return ()
    same = []
    for other in others:
        lost = strength - float(np.sum((other.basis.T @ signal) ** 2))
        if other is not c and lost < INSEPARABLE and other.rank <= c.rank + 1:
            same.append(other.name)
    return tuple(same)


def with_rivals(best: RowCandidate, found: Sequence[RowCandidate], before: Fit) -> RowCandidate:
    """`best`, one of the candidates `found` on top of `before`, with all that may stand in its place."""
    if best.p_value >= SIGNIFICANT:
        return best
    by_name = {c.name: c for c in found}
    like = [name for name in best.indistinguishable_from if name not in by_name or _open(by_name[name], best, before)]
    near = [c for c in found if c.name not in (best.name, *best.indistinguishable_from) and _near(c, best)]
    own = twice_log_likelihood(added(before, best)) if near else 0.0
    further = [c.name for c in near if _may_be(added(before, c), before, own)]
    return replace(best, indistinguishable_from=(*like, *further))


def _open(c: RowCandidate, best: RowCandidate, before: Fit) -> bool:
    """Whether a rival that has `best` within it may still be more: the data then leave a part of it undetermined.

    A play whose width is known to be none is no rival; one that no reversal has shown may have any width.
    """
    if best.name not in c.effect.contains:
        return True
    return not all(e.identified for e in added(before, c).model.estimates(c.name))


def _near(c: RowCandidate, best: RowCandidate) -> bool:
    """Whether it explains much of the same with hardly more parameters. Neither is within the other: that is tested."""
    within = best.name in c.effect.contains or c.name in best.effect.contains
    return not within and c.rank <= best.rank + 1 and c.gain > SAME_SHAPE * best.gain


def _may_be(after: Fit, before: Fit, likeliest: float) -> bool:
    """`likeliest`: twice the log-likelihood with the effect whose rival this is."""
    if likeliest - twice_log_likelihood(after) < INSEPARABLE:
        return True
    as_good = after.pooled_excess <= MATERIAL and after.share_left(before) <= MOST_BY_FORM
    return as_good and not after.table.type.moving
