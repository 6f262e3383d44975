"""A look at one sensor: the model fitted, and how much each effect and each pattern could take off what is left.

All candidates are judged at once from one Gram matrix: columns made white under the sensor's own noise and freed of the
model (Frisch, Waugh and Lovell), as `calibrations/search/screen.py` does one by one. Where the noise has a slow part,
the candidates are also weighed against it (`noise_fit.gains`), as a diagnosis does. What is kept is small: scores and
information add up over sensors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.special import chdtrc, fdtrc

from calibrations.effect import Effect
from calibrations.fit import Fit, cautiously
from calibrations.fleet.columns import Group, Groups, Shared
from calibrations.model import Model
from calibrations.noise_estimation.noise_fit import gains
from calibrations.search.identify import covariance
from calibrations.search.outliers import fit_without
from calibrations.search.screen import SMALLEST, Screen, of_search
from calibrations.search.structure import without_slow
from calibrations.table import Array, Table

LEAST = 1e-10  # eigenvalue of a Gram matrix of columns of length 1: less is rounding

LIKELY = 0.05  # chance, if all that is slow were an effect's, below which it is weighed against slow noise


@dataclass(frozen=True, slots=True)  # a batch of a thousand sensors has 35,000
class Score:
    """One effect at one start, to first order beside the model: score (k,) and information (k, k) of its parameters.

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
class Stage:
    """Score (k,) and information (k, k) of the parameters of the effects on the pose, all together; their names."""

    names: tuple[tuple[str, str, str], ...]  # effect, parameter, unit
    score: Array
    information: Array


NOWHERE = Stage((), np.zeros(0), np.zeros((0, 0)))  # of a sensor on no stage


@dataclass(frozen=True)
class Look:
    """What is kept of one sensor. `information` (p, p) is the inverse covariance of the parameters `theta` (p,), with
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
    stage: Stage


def look(table: Table, model: Model, shared: Shared) -> Look:
    """Fit `model` to `table` and weigh what `shared` holds for its design. Raises what `fit` raises."""
    found, outliers = fit_without(model, table)
    groups = shared.of(found)
    columns = [group.of(found.table) for group in groups.all]
    screen = Screen(found)
    scores, chance, gram, along = _weighed(screen, groups, columns)
    return Look(
        unit=table.unit,
        names=tuple((found.model.terms[s.term].name, s.parameter.name, s.axis, _unit(found, s.parameter.unit))
                    for s in found.problem.layout.slots),
        theta=found.theta,
        information=information(found),
        typical=found.problem.layout.typical,
        rows=found.residual.size,
        free=screen.free,
        excess=found.pooled_excess,
        chance=chance,
        outliers=outliers,
        scores=scores,
        stage=_stage(groups, shared.effects, gram, along),
    )  # fmt: skip


def _unit(found: Fit, unit: str) -> str:
    return unit.replace("{out}", found.problem.layout.unit)


def information(found: Fit) -> Array:
    """Inverse covariance (p, p) of the parameters, with the standard uncertainties that the fit states."""
    cautious = cautiously(found)
    white = cautious.whitened[:, 1:] / cautious.birge
    own = np.sqrt(np.diag(covariance(white, found.problem.layout.typical)[0]))
    stated = np.array([e.std or 0.0 for term in found.model.terms for e in term.estimates])
    wider = np.where((own > 0) & (stated > 0), stated / np.where(own > 0, own, 1.0), 1.0)
    return np.asarray((white.T @ white) / np.outer(wider, wider))


def _weighed(screen: Screen, groups: Groups, columns: list[Array]) -> tuple[tuple[Score, ...], float, Array, Array]:
    """The effects' scores, the chance of the best of all, and Gram matrix and score of all columns freed."""
    found = screen.fit
    white = found.noise.whiten(np.concatenate(columns, axis=2))
    size = np.linalg.norm(white, axis=0)
    free = white - screen.explained @ (screen.explained.T @ white)
    free[:, np.linalg.norm(free, axis=0) <= SMALLEST * size] = 0.0
    gram, along = free.T @ free, free.T @ screen.residual
    edges = np.cumsum([0, *(each.shape[2] for each in columns)])
    blocks = [slice(a, b) for a, b in pairwise(edges)]
    statistics, ranks = statistics_of([gram[b, b] for b in blocks], [along[b] for b in blocks])
    free_rows = min(screen.free, found.noise.freedom)
    single = np.where(ranks > 0, fdtrc(np.maximum(ranks, 1), free_rows, statistics / np.maximum(ranks, 1)), 1.0)
    single = np.minimum(single, _beside_slow_noise(found, groups, columns, ranks))
    scores = tuple(
        Score(g.effect, g.start, along[b], gram[b, b], float(s), int(r), float(p))
        for g, b, s, r, p in zip(groups.all, blocks, statistics, ranks, single, strict=True)
        if g.effect and r
    )
    return scores, float(of_search(float(single.min()), groups.trials)), gram, along


def statistics_of(grams: list[Array], scores: list[Array]) -> tuple[Array, Array]:
    """What the sum of squares falls by with each group of columns, and its rank, from Gram matrices and scores."""
    wide = max(map(len, scores))
    padded, sides = np.zeros((len(grams), wide, wide)), np.zeros((len(grams), wide))
    for k, (gram, score) in enumerate(zip(grams, scores, strict=True)):
        padded[k, : len(score), : len(score)], sides[k, : len(score)] = gram, score
    size = np.sqrt(np.diagonal(padded, axis1=1, axis2=2))
    scale = np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 0.0)
    values, vectors = np.linalg.eigh(padded * scale[:, :, None] * scale[:, None, :])
    along = np.einsum("gkj,gk->gj", vectors, sides * scale)
    kept = values > LEAST
    return np.sum(np.where(kept, along**2 / np.where(kept, values, 1.0), 0.0), axis=1), kept.sum(axis=1)


def _beside_slow_noise(found: Fit, groups: Groups, columns: list[Array], ranks: Array) -> Array:
    """How often noise alone gains as much as each effect where the noise is fitted anew beside it.

    1 for patterns, where no slow noise was found, so that there is nothing to weigh an effect against, and for effects
    that would be nothing even without any slow noise.
    """
    p_values = np.ones(len(columns))
    effects = [k for k, group in enumerate(groups.all) if group.effect and ranks[k]]
    if not effects or not np.any(found.noise.slow):
        return p_values
    tried = [k for k, p in zip(effects, _without_slow(found, [columns[k] for k in effects]), strict=True) if p < LIKELY]
    scaled = [columns[k] / np.maximum(np.sqrt(np.sum(columns[k] ** 2, axis=(0, 1))), 1e-300) for k in tried]
    smooth = found.problem.smooth
    worth = np.array(gains(found.noise, found.residual, found.jacobian, scaled, smooth)) if tried else np.zeros(0)
    rows, rank = found.residual.size, ranks[tried]
    free = np.maximum(rows - found.jacobian.shape[2] - rank - smooth.shape[1] * len(found.channels), 1)
    p_values[tried] = fdtrc(rank, free, np.expm1(np.minimum(worth / rows, 500.0)) * free / rank)
    return p_values


def _without_slow(found: Fit, columns: list[Array]) -> Array:
    """Chances of the effects if all that is slow were theirs to explain."""
    screen = Screen(without_slow(found))
    falls = screen.reductions(columns)
    ranks = np.array([each.shape[2] for each in columns])
    level = max(float(screen.residual @ screen.residual) / screen.free, 1.0)
    return np.asarray(chdtrc(ranks, falls / level))


def _stage(groups: Groups, effects: Mapping[str, Effect], gram: Array, along: Array) -> Stage:
    """The effects on the pose that are not in the model, from their first start."""
    names: list[tuple[str, str, str]] = []
    places: list[int] = []
    at = 0
    for group in groups.all:
        if _of_stage(group, effects):
            names += [(group.effect, p.name, p.unit) for p in effects[group.effect].parameters]
            places += range(at, at + group.columns.shape[2])
        at += group.columns.shape[2]
    return Stage(tuple(names), along[places], gram[np.ix_(places, places)])


def _of_stage(group: Group, effects: Mapping[str, Effect]) -> bool:
    return bool(group.effect) and group.start == 0 and effects[group.effect].pose is not None
