"""Every effect of the catalogue that a table can excite, tried on top of a fitted model.

Each is judged jointly with the model and with the noise fitted anew: a candidate may win only what slow noise does not
already take up. First order about the present fit; the best are then refitted in full.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from calibrations.coverage import uncovered
from calibrations.effect import Effect
from calibrations.fit import Fit, refit
from calibrations.noise import rms
from calibrations.noise_estimation.noise_fit import gains
from calibrations.parameters import Layout
from calibrations.problem import Problem
from calibrations.search.held_out import held_out_excess
from calibrations.search.screen import Screen, Search, of_search
from calibrations.table import Array

SIGNIFICANT = 0.003  # chance of naming anything at all where nothing is missing, over the whole search
OFFSETS = {"bias", "hard-iron", "gyro-bias"}
DRIFTING = {"t_s", "temperature_c"}  # what an effect goes by that lets an offset drift
SAME = 3  # decimals of twice the log-likelihood: less is rounding, and the catalogue's order counts
NOT_TOLD_APART = 6.0  # a loss of twice the log-likelihood below this: odds of less than 20 to 1


@dataclass(frozen=True)
class Candidate:
    """One effect on top of a model. `gain` is twice the gain in log-likelihood, `rank` the parameters that it adds."""

    effect: Effect
    rank: int
    gain: float
    p_value: float
    excess_after: float
    held_out_after: float
    probability: float
    start: Array
    columns: Array
    basis: Array
    indistinguishable_from: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The effect's name."""
        return self.effect.name


def candidates(before: Fit, effects: Mapping[str, Effect]) -> list[Candidate]:
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
    unseen = held_out_excess(before)
    found = _with_probabilities(found, before.residual.size, unseen)
    found.sort(key=lambda c: (c.held_out_after < unseen, round(schwarz(c, before.residual.size), SAME)), reverse=True)
    like = [_like(c, found, screen) for c in found]
    return [
        replace(c, indistinguishable_from=(*names, *_unlogged(c.effect, before, effects)))
        for c, names in zip(found, like, strict=True)
    ]


def best_pair(before: Fit, found: list[Candidate]) -> tuple[Candidate, Candidate] | None:
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
    """Chance of such a gain on noise. F rather than chi-squared: the noise's level is estimated from these rows."""
    return float(fdtrc(rank, free, np.expm1(min(twice_gain / rows, 500.0)) * free / rank))


def schwarz(c: Candidate, rows: int) -> float:
    """Gain less the price of the parameters, log(rows) each."""
    return c.gain - c.rank * float(np.log(rows))


def added(before: Fit, c: Candidate) -> Fit:
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
    askable = effect.kinds == ("fields",) or uncovered(before.table) is None
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
) -> Candidate:
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
    return Candidate(
        effect=effect,
        rank=rank,
        gain=worth - 2 * float(np.log(searched)),
        p_value=float(of_search(min(p_score, p_refitted), tests * trials * searched)),
        excess_after=float(np.sqrt(np.mean((rms(after) / before.noise.floor) ** 2))),
        held_out_after=held_out_excess(before, columns),
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


def _with_probabilities(found: list[Candidate], rows: int, unseen: float) -> list[Candidate]:
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
    if "t_s" not in effect.needs or before.table.kind != "poses":
        return ()
    return tuple(
        name
        for name, other in effects.items()
        if name in effect.confused_with and "temperature_c" in other.needs and "temperature_c" not in before.table
    )


def _like(c: Candidate, others: list[Candidate], screen: Screen) -> tuple[str, ...]:
    """Candidates that would take up nearly all that `c` takes up, with at most one parameter more."""
    signal = c.basis @ (c.basis.T @ screen.residual)
    strength = float(signal @ signal)
    if strength < 2 * NOT_TOLD_APART:
        return ()
    same = []
    for other in others:
        lost = strength - float(np.sum((other.basis.T @ signal) ** 2))
        if other is not c and lost < NOT_TOLD_APART and other.rank <= c.rank + 1:
            same.append(other.name)
    return tuple(same)
