"""Gross outliers: poses whose residual is far from that of all poses around them.

A knock, a lost packet or a mistyped reading spoils one pose; an effect of the sensor or the rig does not stop between
one pose and the next. The test compares each pose with the nearest poses in direction of gravity, by medians. If
those disagree (a loop of hysteresis, an edge, noise), the threshold is higher. A deviation that lasts for some poses
in time, or repeats at the same pose, is no outlier. If all outliers are the ends of an output, read too small, and
chance does not explain that, the output may have a limit that no other pose reaches: then they are none either. A
search for effects leaves outliers out, and messages always name them; a person decides whether to exclude them.

Source  Rousseeuw and Croux, J. Am. Statist. Assoc. 88 (1993), 1273: the median of absolute deviations as a scale.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from calibrations.criteria import GROSS, MOST_GROSS, SAME_G, SIGNIFICANT
from calibrations.fitting.fit import Fit, fit
from calibrations.geometry.orientation import reported_force
from calibrations.means.noise import robust_std
from calibrations.model import Model
from calibrations.table import Array, Table

NEIGHBOURS = 6
COUNTED = "(counted from 0, including excluded poses)"
LEAVE_OUT = (
    "check them; to leave them out of every analysis, use `rig exclude RUN POSE --reason TEXT`, or in a file a column "
    "`excluded` with 1"
)


def gross(complete: Fit) -> NDArray[np.intp]:
    """Gross outliers, as rows in order of time; none in tables other than poses, and none if they are many."""
    table = complete.table
    if not table.type.stage_angles or table.n < 3 * NEIGHBOURS:
        return np.zeros(0, dtype=np.intp)
    direction = reported_force(table)
    neighbour_residuals = complete.residual[:, _nearest(direction)]
    middle = np.median(neighbour_residuals, axis=2)
    deviation = complete.residual - middle
    spread = robust_std(neighbour_residuals - middle[:, :, None], axis=2)
    usual = robust_std(deviation, axis=1)[:, None]
    suspects = np.flatnonzero(np.any(np.abs(deviation) > GROSS * np.maximum(spread, usual), axis=0))
    rows = np.array(
        [
            row
            for row in map(int, suspects)
            if not (_lasts(row, complete, deviation) or _returns(row, complete, deviation, direction))
        ],
        dtype=np.intp,
    )
    return rows[:0] if len(rows) > MOST_GROSS * table.n or _may_reach_limit(complete, rows) else rows


def _may_reach_limit(complete: Fit, rows: NDArray[np.intp]) -> bool:
    """Whether each row is the largest or smallest expected value of an output, and is measured nearer to the others.

    Of n rows with c outputs, a knock of any sign at any row is such an end with a probability of c/n.
    """
    expected = complete.table.outputs.T - complete.residual
    chance = (len(expected) / complete.table.n) ** len(rows)
    if not len(rows) or chance >= SIGNIFICANT:
        return False
    channels = zip(expected, complete.residual, strict=True)
    ends = {
        int(end)
        for values, residual in channels
        for end, inward in ((np.argmax(values), -1), (np.argmin(values), 1))
        if inward * residual[end] > 0
    }
    return ends.issuperset(map(int, rows))


def _nearest(directions: Array) -> NDArray[np.intp]:
    """Nearest rows of each row, without the row itself, shape (n, NEIGHBOURS)."""
    n = len(directions)
    neighbours: NDArray[np.intp] = np.asarray(cKDTree(directions).query(directions, NEIGHBOURS + 1)[1])
    is_other = neighbours != np.arange(n)[:, None]
    is_other[np.all(is_other, axis=1), -1] = False  # a row among many in one place may not be in its own list
    return np.asarray(neighbours[is_other].reshape(n, NEIGHBOURS))


def _lasts(row: int, complete: Fit, deviation: Array) -> bool:
    """Whether the poses before and after deviate as much."""
    first = min(max(row - NEIGHBOURS // 2, 0), complete.table.n - NEIGHBOURS - 1)
    neighbours = [k for k in range(first, first + NEIGHBOURS + 1) if k != row]
    return any(
        _is_repeated(deviation[:, row], values[:, row] - np.median(values[:, neighbours], axis=1))
        for values in (deviation, complete.residual)
    )


def _returns(row: int, complete: Fit, deviation: Array, direction: Array) -> bool:
    """Whether the same pose deviates as much at another time."""
    same_pose = np.flatnonzero(np.linalg.norm(direction - direction[row], axis=1) < SAME_G).tolist()
    return any(
        _is_repeated(deviation[:, row], complete.residual[:, row] - complete.residual[:, k])
        for k in same_pose
        if k != row
    )


def _is_repeated(deviation: Array, difference: Array) -> bool:
    """Whether the `difference` of two rows is much smaller than the `deviation` of one of them."""
    return float(np.linalg.norm(difference)) < float(np.linalg.norm(deviation)) / 2


def fit_without(model: Model, table: Table) -> tuple[Fit, tuple[int, ...]]:
    """The model fitted to all but gross outliers, and their numbers (`Table.numbered`). Raises what `fit` raises."""
    complete = fit(model, table)
    rows = gross(complete)
    if not len(rows):
        return complete, ()
    return fit(model, table.rows(np.delete(table.order, rows))), tuple(map(int, complete.table.numbered(rows)))


def outlier_text(numbers: tuple[int, ...], row_word: str = "poses", limit: int | None = None) -> str:
    """The outlying rows, the first `limit` of them by their numbers."""
    listed = ", ".join(f"#{number}" for number in numbers[:limit])
    unlisted = f" and {len(numbers) - limit} more" if limit is not None and len(numbers) > limit else ""
    subject = f"{row_word.removesuffix('s')} differs" if len(numbers) == 1 else f"{row_word} differ"
    return f"{len(numbers)} {subject} from the others: {listed}{unlisted}"


def outliers_in_fit(complete: Fit) -> str | None:
    """A sentence on the gross outliers in a fit of all rows, and on how to exclude them; None if there are none."""
    rows = gross(complete)
    numbers = tuple(map(int, complete.table.numbered(rows)))
    return f"{outlier_text(numbers)} {COUNTED}, still in this fit: {LEAVE_OUT}" if numbers else None


def caution(rows: tuple[int, ...]) -> str | None:
    """A sentence on the outliers that a fit excludes, and on how to exclude them for good; None if there are none."""
    if not rows:
        return None
    return f"{outlier_text(rows)} {COUNTED}; left out of this fit as outliers: {LEAVE_OUT}"
