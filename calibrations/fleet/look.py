"""Possible contributions of effects and patterns to a residual, computed once for all sensors of one design.

Derivatives of the residual are the most expensive part, and at the same poses they are nearly the same for every
sensor: an effect on pose or force is proportional to the range of the output, an effect on transduction does not depend
on the sensor. They are therefore computed for the first sensor of a design and scaled for the others; the choice of the
first sensor changes the result hardly. The derivatives of an effect that needs columns beside the angles (time,
temperature) or constants of the table are shared only by sensors with the same ones; those of an effect on the output
are not shared. Only poses are a design: in tables of positions and rates the outputs themselves give the orientation of
a sensor, and nothing is shared.

An effect whose start values are searched in the data (`Effect.searched`) is left out, because it needs a refit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

import numpy as np
from scipy.special import chdtrc, fdtrc

from calibrations.criteria import NOT_SHOWN, POSSIBLY_SLOW
from calibrations.discovery.candidates import testable_effects
from calibrations.discovery.outliers import fit_without
from calibrations.discovery.patterns import patterns
from calibrations.discovery.significance import Screen, Search, of_search
from calibrations.discovery.structure import without_slow
from calibrations.effects import Effect
from calibrations.fitting.fit import Fit
from calibrations.fitting.identifiability import covariance
from calibrations.fitting.noise_fit import gains
from calibrations.fitting.problem_kinds import make_problem
from calibrations.model import Model
from calibrations.table import Array, Table

ANGLES = ("alpha_deg", "beta_deg", "direction", "mount_deg", "flip")
Key = tuple[str | bytes, ...]
MOST_CACHED = 300

V = TypeVar("V")


@dataclass(frozen=True)
class Group:
    """Columns (channels, n, k) that belong together: one effect at one of its starts, or one pattern.

    `scaled`: they go with the range of the output, and are given per unit of it.
    """

    effect: str  # "" for a pattern
    start: int
    columns: Array
    scaled: bool = False

    def of(self, table: Table) -> Array:
        """The columns for a sensor that was measured on the same design."""
        return self.columns * _ranges(table, len(self.columns)) if self.scaled else self.columns


@dataclass(frozen=True)
class SearchGroups:
    """The groups of columns of a search on one design. `trials`: the number of independent tests."""

    all: tuple[Group, ...]
    trials: float


class SharedDesigns:
    """The columns of the designs met lately, of `effects` in addition to one model."""

    def __init__(self, effects: Mapping[str, Effect]) -> None:
        self.effects = effects
        self._asked: dict[Key, tuple[Effect, ...]] = {}
        self._groups: dict[Key, tuple[Group, ...]] = {}
        self._trials: dict[Key, float] = {}

    def of(self, fit: Fit) -> SearchGroups:
        """The groups for a fitted table."""
        table = fit.table
        design = _key(table, ())
        can: Key = (*table.columns, *design)
        effects = _get_cached(self._asked, can, lambda: _screen_effects(fit, self.effects))
        groups = [group for effect in effects for group in self._effect(fit, effect)]
        shapes: tuple[Group, ...] = _get_cached(self._groups, design, lambda: tuple(_patterns(fit)))
        groups += shapes
        search: Key = (*(effect.name for effect in effects), *design)
        return SearchGroups(tuple(groups), _get_cached(self._trials, search, lambda: _trials(fit, groups)))

    def _effect(self, fit: Fit, effect: Effect) -> tuple[Group, ...]:
        if "output" in effect.places:
            return tuple(_derivatives(fit, effect))
        constants = np.array([float(constant(fit.table)) for constant in effect.constants.values()])
        key = (effect.name, constants.tobytes(), *_key(fit.table, effect.needs))
        return _get_cached(self._groups, key, lambda: tuple(_derivatives(fit, effect)))


def _get_cached(cache: dict[Key, V], key: Key, make: Callable[[], V]) -> V:
    """The value for a key, made once. The cache is cleared at MOST values, so that memory stays bounded."""
    value = cache.get(key)
    if value is None:
        value = make()
        if len(cache) >= MOST_CACHED:
            cache.clear()
        cache[key] = value
    return value


def _screen_effects(fit: Fit, effects: Mapping[str, Effect]) -> tuple[Effect, ...]:
    return tuple(effect for effect in testable_effects(fit, effects) if effect.searched(fit.table) <= 1)


def _key(table: Table, required: tuple[str, ...]) -> Key:
    """The variables that determine columns at rows in order of time."""
    design = ANGLES if table.type.stage_angles else table.columns
    names = [name for name in dict.fromkeys((*design, *required)) if name in table]
    return tuple(part for name in names for part in (name, table.column(name).tobytes()))


def _ranges(table: Table, channels: int) -> Array:
    """The range of each channel's output, (channels, 1, 1); 1 if the residual is not one of an output."""
    ranges = np.asarray(np.ptp(table.outputs, axis=0))
    return (ranges if len(ranges) == channels else np.ones(channels))[:, None, None]


def _derivatives(fit: Fit, effect: Effect) -> Iterator[Group]:
    """Derivatives of the residual with respect to the effect's parameters, at each of its starts."""
    problem = make_problem(fit.model.with_effect(effect), fit.table)
    own_columns = problem.layout.of_effect(effect.name)
    scaled = bool(effect.places & {"pose", "force"})
    for start, theta in enumerate(problem.layout.starts()):
        columns = problem.jacobian(theta, own_columns)
        if np.any(columns):
            yield Group(effect.name, start, columns / _ranges(fit.table, len(columns)) if scaled else columns, scaled)


def _patterns(fit: Fit) -> Iterator[Group]:
    """Effects of poses that angles and the order of rows can show: equal for all sensors of a design."""
    table = fit.table
    if table.type.stage_angles:
        names = [name for name in (*ANGLES, *table.output_names) if name in table]
        table = Table.from_columns(table.kind, {name: table.column(name) for name in names})
    return (Group("", k, pattern.columns) for k, pattern in enumerate(patterns(table, fit.channels)))


def _trials(fit: Fit, groups: list[Group]) -> float:
    """The number of independent tests that the search equals under white noise alone."""
    screen = Screen(without_slow(fit))
    return Search(screen, [screen.basis(group.of(fit.table)) for group in groups]).trials


# A look at one sensor: the fitted model, and the part of the residual that each effect and each pattern can explain.
#
# All candidates are judged at once from one Gram matrix: their columns are made white with the noise of the sensor and
# orthogonal to the model (Frisch, Waugh and Lovell), as `discovery/significance.py` does one by one. If the noise has a
# slow part, the candidates are also compared with it (`noise_fit.gains`), as a diagnosis does. The results are small:
# scores and information, which add up over sensors.

LEAST_RANK = 1e-10  # eigenvalue of a Gram matrix of columns of length 1: less is rounding


@dataclass(frozen=True, slots=True)  # a batch of a thousand sensors has 35,000
class Score:
    """One effect at one start, to first order, added to the model: score (k,) and information (k, k) of its parameters.

    `statistic` is what the whitened sum of squares would fall by, `rank` its degrees of freedom, `p_value` how often
    noise alone does as much.
    """

    effect: str
    start: int
    score: Array
    information: Array
    statistic: float
    rank: int
    p_value: float


@dataclass(frozen=True)
class StageScore:
    """Score (k,) and information (k, k) of the parameters of the effects on the pose, all together; their names."""

    names: tuple[tuple[str, str, str], ...]  # effect, parameter, unit
    score: Array
    information: Array


NO_STAGE = StageScore((), np.zeros(0), np.zeros((0, 0)))  # of a sensor on no stage


@dataclass(frozen=True)
class Screening:
    """The result for one sensor. `information` (p, p) is the inverse covariance of the parameters `theta` (p,), with
    all that their standard uncertainties are widened by; `typical` what a sensor may show.

    `chance`: that noise alone shows as much, over the whole search. `excess` is the error over the noise floor.
    """

    unit: str  # of the output
    names: tuple[tuple[str, str, str, str], ...]  # effect, parameter, axis, unit
    theta: Array
    information: Array
    typical: Array
    rows: int
    free: int
    excess: float
    chance: float
    outliers: tuple[int, ...]
    scores: tuple[Score, ...]
    stage: StageScore


def screen_sensor(table: Table, model: Model, shared: SharedDesigns) -> Screening:
    """Fit `model` to `table` and weigh what `shared` holds for its design. Raises what `fit` raises."""
    fit, outliers = fit_without(model, table)
    groups = shared.of(fit)
    columns = [group.of(fit.table) for group in groups.all]
    screen = Screen(fit)
    scores, chance, gram, scores_of_columns = _score_effects(screen, groups, columns)
    return Screening(
        unit=table.unit,
        names=tuple((fit.model.terms[s.term].name, s.parameter.name, s.axis, _unit(fit, s.parameter.unit))
                    for s in fit.problem.layout.slots),
        theta=fit.theta,
        information=information(fit),
        typical=fit.problem.layout.typical,
        rows=fit.residual.size,
        free=screen.free,
        excess=fit.pooled_excess,
        chance=chance,
        outliers=outliers,
        scores=scores,
        stage=_stage(groups, shared.effects, gram, scores_of_columns),
    )  # fmt: skip


def _unit(fit: Fit, unit: str) -> str:
    return unit.replace("{out}", fit.problem.layout.unit)


def information(fit: Fit) -> Array:
    """Inverse covariance (p, p) of the parameters, with the standard uncertainties that the fit states."""
    cautious = fit.in_all_noise()
    white = cautious.information
    white_std = np.sqrt(np.diag(covariance(white, fit.problem.layout.typical)[0]))
    stated_std = np.array([e.std or 0.0 for e in fit.params.values()])
    wider = np.where((white_std > 0) & (stated_std > 0), stated_std / np.where(white_std > 0, white_std, 1.0), 1.0)
    return np.asarray((white.T @ white) / np.outer(wider, wider))


def _score_effects(
    screen: Screen, groups: SearchGroups, columns: list[Array]
) -> tuple[tuple[Score, ...], float, Array, Array]:
    """The effects' scores, the chance of the best of all, and Gram matrix and score of all columns freed."""
    fit = screen.fit
    white = fit.noise.whiten(np.concatenate(columns, axis=2))
    size = np.linalg.norm(white, axis=0)
    free = white - screen.explained @ (screen.explained.T @ white)
    free[:, np.linalg.norm(free, axis=0) <= NOT_SHOWN * size] = 0.0
    gram, projections = free.T @ free, free.T @ screen.residual
    edges = np.cumsum([0, *(column.shape[2] for column in columns)])
    blocks = [slice(a, b) for a, b in pairwise(edges)]
    statistics, ranks = statistics_of([gram[b, b] for b in blocks], [projections[b] for b in blocks])
    free_rows = min(screen.free, fit.noise.freedom)
    single = np.where(ranks > 0, fdtrc(np.maximum(ranks, 1), free_rows, statistics / np.maximum(ranks, 1)), 1.0)
    single = np.minimum(single, _chance_with_slow_noise(fit, groups, columns, ranks))
    scores = tuple(
        Score(g.effect, g.start, projections[b], gram[b, b], float(s), int(r), float(p))
        for g, b, s, r, p in zip(groups.all, blocks, statistics, ranks, single, strict=True)
        if g.effect and r
    )
    return scores, float(of_search(float(single.min()), groups.trials)), gram, projections


def statistics_of(grams: list[Array], scores: list[Array]) -> tuple[Array, Array]:
    """Reduction of the sum of squares by each group of columns, and its rank, from Gram matrices and scores."""
    wide = max(map(len, scores))
    padded, sides = np.zeros((len(grams), wide, wide)), np.zeros((len(grams), wide))
    for k, (gram, score) in enumerate(zip(grams, scores, strict=True)):
        padded[k, : len(score), : len(score)], sides[k, : len(score)] = gram, score
    size = np.sqrt(np.diagonal(padded, axis1=1, axis2=2))
    scale = np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 0.0)
    values, vectors = np.linalg.eigh(padded * scale[:, :, None] * scale[:, None, :])
    components = np.einsum("gkj,gk->gj", vectors, sides * scale)
    is_determined = values > LEAST_RANK
    return np.sum(
        np.where(is_determined, components**2 / np.where(is_determined, values, 1.0), 0.0), axis=1
    ), is_determined.sum(axis=1)


def _chance_with_slow_noise(fit: Fit, groups: SearchGroups, columns: list[Array], ranks: Array) -> Array:
    """How often noise alone gains as much as each effect if the noise is fitted again with it.

    1 for patterns, where no slow noise was found, so that there is nothing to weigh an effect against, and for effects
    that would be nothing even without any slow noise.
    """
    p_values = np.ones(len(columns))
    effects = [k for k, group in enumerate(groups.all) if group.effect and ranks[k]]
    if not effects or not np.any(fit.noise.slow):
        return p_values
    tested = [
        k for k, p in zip(effects, _without_slow(fit, [columns[k] for k in effects]), strict=True) if p < POSSIBLY_SLOW
    ]
    scaled = [columns[k] / np.maximum(np.sqrt(np.sum(columns[k] ** 2, axis=(0, 1))), 1e-300) for k in tested]
    smooth = fit.problem.smooth
    gained = np.array(gains(fit.noise, fit.residual, fit.jacobian, scaled, smooth)) if tested else np.zeros(0)
    rows, rank = fit.residual.size, ranks[tested]
    free = np.maximum(rows - fit.jacobian.shape[2] - rank - smooth.shape[1] * len(fit.channels), 1)
    p_values[tested] = fdtrc(rank, free, np.expm1(np.minimum(gained / rows, 500.0)) * free / rank)
    return p_values


def _without_slow(fit: Fit, columns: list[Array]) -> Array:
    """Chances of the effects if all that is slow were theirs to explain."""
    screen = Screen(without_slow(fit))
    falls = screen.reductions(columns)
    ranks = np.array([column.shape[2] for column in columns])
    level = max(float(screen.residual @ screen.residual) / screen.free, 1.0)
    return np.asarray(chdtrc(ranks, falls / level))


def _stage(groups: SearchGroups, effects: Mapping[str, Effect], gram: Array, projections: Array) -> StageScore:
    """The effects on the pose that are not in the model, from their first start."""
    names: list[tuple[str, str, str]] = []
    places: list[int] = []
    start = 0
    for group in groups.all:
        if _is_of_stage(group, effects):
            names += [(group.effect, p.name, p.unit) for p in effects[group.effect].parameters]
            places += range(start, start + group.columns.shape[2])
        start += group.columns.shape[2]
    return StageScore(tuple(names), projections[places], gram[np.ix_(places, places)])


def _is_of_stage(group: Group, effects: Mapping[str, Effect]) -> bool:
    return bool(group.effect) and group.start == 0 and "pose" in effects[group.effect].places
