"""An effect's curve through the residual: what adding it changes, over the column that tells most, and what is left.

The most telling column is the one of which the change is nearest to a function, apart for each direction of turning.
Where none will do, as for an effect of two angles at once, the residual is drawn against the change itself: what the
effect explains then lies along the diagonal.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from calibrations.discover import Added
from calibrations.pictures.columns import Column, label_column, telling_columns
from calibrations.pictures.style import INK, floor_band, panels, styled
from calibrations.pictures.view import dots, groups, key, label_residual, row_height, shown_unit
from calibrations.table import Array

MOST_PARTS = 24  # of a column, for each direction
ROWS_IN_A_PART = 6
TELLING = 0.8  # part of the change's variance that a function of the column must give
EQUAL = 0.02  # columns closer than this tell the same: the plainer cause is drawn


@styled
def picture(step: Added) -> Figure:
    """A row for each axis: residual before with the effect's curve through it, and residual after, on one scale.

    A full line is what it explains on clockwise approaches, a broken one on anticlockwise approaches.
    """
    before, after = step.before, step.after
    found, column = groups(before), most_telling(step)
    figure, axes = panels(len(before.channels), 2, row_height(before), sharex="row", sharey="row")
    for c, (left, right) in enumerate(axes):
        for ax, fit in ((left, before), (right, after)):
            floor_band(ax, 1e3 * float(before.noise.floor[c]))
            for group in found:
                dots(ax, group, column.values[c, group.rows], 1e3 * fit.residual[c, group.rows])
            label_column(ax, column, c, last=True)
            label_residual(ax, before, c, last=ax is right)
        for side, x, y in curves(step, column, c):
            left.plot(x, 1e3 * y, color="white", lw=3.6, zorder=3)
            left.plot(x, 1e3 * y, color=INK, lw=1.6, ls="-" if side >= 0 else "--", zorder=4)
    axes[0, 0].set_title(f"before; the line: what {step.name} explains")
    axes[0, 1].set_title("after")
    key(figure, found)
    return figure


def change_of(step: Added) -> Array:
    """What adding the effect takes off the residual, the other parameters refitted, shape (channels, n)."""
    return step.before.residual - step.after.residual


def most_telling(step: Added) -> Column:
    """The plainest column that the change follows; the change itself where it follows none."""
    change, sides = change_of(step) / step.before.noise.floor[:, None], _sides(step)
    effect = next(term.effect for term in step.after.model.terms if term.name == step.name)
    found = telling_columns(step.before, effect)
    told = np.array([explained(change, column.values, sides) for column in found])
    if step.before.table.kind == "motion":
        return found[0]
    if told.max() < TELLING:
        label = f"change made by {step.name} ({shown_unit(step.before)})"
        return Column("change", (label,) * len(change), 1e3 * change_of(step))
    return found[int(np.argmax(told >= told.max() - EQUAL))]


def explained(change: Array, values: Array, sides: Array) -> float:
    """Part of the change's variance that is a function of the column, for each side apart; shapes (channels, n)."""
    left = 0.0
    for y, x in zip(change, values, strict=True):
        part = _parts(x, sides)
        mean = np.bincount(part, y) / np.bincount(part)
        left += float(np.sum((y - mean[part]) ** 2))
    total = float(np.sum((change - change.mean(axis=1, keepdims=True)) ** 2))
    return 1 - left / total if total > 0 else 0.0


def curves(step: Added, column: Column, c: int) -> Iterator[tuple[float, Array, Array]]:
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
        at = np.flatnonzero(side == s)
        at = at[np.argsort(x[at], kind="stable")]
        yield float(s), x[at], y[at]


def _sides(step: Added) -> Array:
    return step.before.table.optional("direction", 0.0)


def _parts(x: Array, sides: Array) -> NDArray[np.intp]:
    """Number of the part that each row is in: stretches of the column with equal numbers of rows, each side apart."""
    most = min(MOST_PARTS, max(len(x) // ROWS_IN_A_PART, 2))
    edges = np.unique(np.quantile(x, np.linspace(0, 1, most + 1)[1:-1]))
    both = np.stack([np.searchsorted(edges, x, side="right"), sides])
    return np.asarray(np.unique(both, axis=1, return_inverse=True)[1]).ravel()
