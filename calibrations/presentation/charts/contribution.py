"""The curve of an effect in the residual: the change that it makes, over the column that tells most about it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from calibrations.discovery.findings import Step
from calibrations.fitting.fit import Fit
from calibrations.means.noise import rms
from calibrations.presentation.residual import Column, residual_unit, select_telling_columns
from calibrations.table import Array

LARGEST_MISS = 0.1  # part of the change's rms by which a curve may miss the change of single rows
MOST_PARTS = 24  # of a column, for each direction
ROWS_IN_A_PART = 6
LEAST_EXPLAINED = 0.8  # part of the change's variance that a function of the column must give
EQUAL = 0.02  # columns closer than this are equal: the simpler cause is drawn


def change_of(step: Step[Fit]) -> Array:
    """Reduction of the residual by the effect, the other parameters refitted, shape (channels, n)."""
    return step.before.residual - step.after.residual


def select_telling_column(step: Step[Fit]) -> Column:
    """The simplest column that explains the change; the change itself if no column explains it."""
    change, sides = change_of(step) / step.before.noise.floor[:, None], _sides(step)
    effect = next(term.effect for term in step.after.model.terms if term.name == step.name)
    candidates = select_telling_columns(step.before, effect)
    shares = np.array([explained_share(change, column.values, sides) for column in candidates])
    if step.before.table.type.moving:
        return candidates[0]
    if shares.max() < LEAST_EXPLAINED:
        label = f"change made by {step.name} ({residual_unit(step.before)})"
        return Column("change", (label,) * len(change), 1e3 * change_of(step))
    return candidates[int(np.argmax(shares >= shares.max() - EQUAL))]


def explained_share(change: Array, values: Array, sides: Array) -> float:
    """Share of the change's variance that is a function of the column, by side; shapes (channels, n)."""
    unexplained = 0.0
    for y, x in zip(change, values, strict=True):
        part = _parts(x, sides)
        mean = np.bincount(part, y) / np.bincount(part)
        unexplained += float(np.sum((y - mean[part]) ** 2))
    total = float(np.sum((change - change.mean(axis=1, keepdims=True)) ** 2))
    return 1 - unexplained / total if total > 0 else 0.0


def curves(step: Step[Fit], column: Column, c: int) -> Iterator[tuple[float, Array, Array]]:
    """The change as a function of the column: (direction of turning, column, change), means in parts of the column."""
    change, sides = change_of(step)[c], _sides(step)
    if column.name == "change":
        ends = np.array([change.min(), change.max()])
        yield 1.0, 1e3 * ends, ends
        return
    part = _parts(column.values[c], sides)
    count = np.bincount(part)
    x, y, side = (np.bincount(part, values) / count for values in (column.values[c], change, sides))
    for s in np.unique(side):
        rows = np.flatnonzero(side == s)
        rows = rows[np.argsort(x[rows], kind="stable")]
        yield float(s), x[rows], y[rows]


def is_function(step: Step[Fit], column: Column, c: int) -> bool:
    """Whether the curves of the change over `column` pass through the change of the single rows.

    They may miss them by LARGEST_MISS of the change's rms, or by the noise floor of one row.
    """
    if column.name == "change" or step.before.table.type.moving:
        return True
    change, sides, x = change_of(step)[c], _sides(step), column.values[c]
    missed = np.zeros(len(change))
    for side, abscissas, values in curves(step, column, c):
        rows = sides == side
        missed[rows] = change[rows] - np.interp(x[rows], abscissas, values)
    limit = max(LARGEST_MISS * float(rms(change)), float(step.before.noise.floor[c]))
    return float(rms(missed)) <= limit


def _sides(step: Step[Fit]) -> Array:
    return step.before.table.optional("direction", 0.0)


def _parts(x: Array, sides: Array) -> NDArray[np.intp]:
    """Part number of each row. Parts are ranges of the column with equal numbers of rows, for each side separately."""
    most = min(MOST_PARTS, max(len(x) // ROWS_IN_A_PART, 2))
    edges = np.unique(np.quantile(x, np.linspace(0, 1, most + 1)[1:-1]))
    keys = np.stack([np.searchsorted(edges, x, side="right"), sides])
    return np.asarray(np.unique(keys, axis=1, return_inverse=True)[1]).ravel()
