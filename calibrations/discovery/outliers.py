"""Gross outliers: poses whose residual is far from that of all poses around them.

A knock, a lost packet or a mistyped reading spoils one pose; an effect of the sensor or the rig does not stop between
one pose and the next. So each pose is compared with the nearest ones in direction of gravity, by medians; where those
disagree among themselves (a loop of hysteresis, an edge, noise) more is needed to stand out. What lasts for some poses
in time, or comes again at the same pose, is no accident. Such poses are set aside while effects are searched for, and
always named: whether they are excluded, a person decides.

Source  Rousseeuw and Croux, J. Am. Statist. Assoc. 88 (1993), 1273: the median of absolute deviations as a scale.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from calibrations.criteria import GROSS, MOST_GROSS, SAME_G
from calibrations.estimators.robust import robust_std
from calibrations.fitting.fit import Fit, fit
from calibrations.geometry.orientation import nominal_pose, specific_force
from calibrations.model import Model
from calibrations.table import Array, Table

NEIGHBOURS = 6
COUNTED = "(counted from 0, including excluded poses)"
LEAVE_OUT = (
    "check them; to leave them out of every analysis, use `rig exclude RUN POSE --reason TEXT`, or in a file a column "
    "`excluded` with 1"
)


def gross(found: Fit) -> NDArray[np.intp]:
    """Rows, in order of time, that are gross outliers; none in tables other than poses, nor where they are many."""
    table = found.table
    if not table.type.stage_angles or table.n < 3 * NEIGHBOURS:
        return np.zeros(0, dtype=np.intp)
    place = specific_force(nominal_pose(table))
    around = found.residual[:, _nearest(place)]
    middle = np.median(around, axis=2)
    own = found.residual - middle
    spread = robust_std(around - middle[:, :, None], axis=2)
    usual = robust_std(own, axis=1)[:, None]
    out = np.flatnonzero(np.any(np.abs(own) > GROSS * np.maximum(spread, usual), axis=0))
    rows = np.array(
        [row for row in map(int, out) if not (_lasts(row, found, own) or _returns(row, found, own, place))],
        dtype=np.intp,
    )
    return rows if len(rows) <= MOST_GROSS * table.n else rows[:0]


def _nearest(places: Array) -> NDArray[np.intp]:
    """Rows around each row, itself left out, shape (n, NEIGHBOURS)."""
    n = len(places)
    near: NDArray[np.intp] = np.asarray(cKDTree(places).query(places, NEIGHBOURS + 1)[1])
    others = near != np.arange(n)[:, None]
    others[np.all(others, axis=1), -1] = False  # of many rows in one place a row need not be among its own nearest
    return np.asarray(near[others].reshape(n, NEIGHBOURS))


def _lasts(row: int, found: Fit, own: Array) -> bool:
    """Whether the poses before and after are off by as much."""
    first = min(max(row - NEIGHBOURS // 2, 0), found.table.n - NEIGHBOURS - 1)
    others = [k for k in range(first, first + NEIGHBOURS + 1) if k != row]
    return any(_near(own[:, row], of[:, row] - np.median(of[:, others], axis=1)) for of in (own, found.residual))


def _returns(row: int, found: Fit, own: Array, place: Array) -> bool:
    """Whether the same pose, come to at another time, is off by as much."""
    there = np.flatnonzero(np.linalg.norm(place - place[row], axis=1) < SAME_G).tolist()
    return any(_near(own[:, row], found.residual[:, row] - found.residual[:, k]) for k in there if k != row)


def _near(own: Array, apart: Array) -> bool:
    """Whether a row that is off by `own` is `apart` from another by much less."""
    return float(np.linalg.norm(apart)) < float(np.linalg.norm(own)) / 2


def fit_without(model: Model, table: Table) -> tuple[Fit, tuple[int, ...]]:
    """The model fitted to all but gross outliers, and their numbers (`Table.numbered`). Raises what `fit` raises."""
    found = fit(model, table)
    rows = gross(found)
    if not len(rows):
        return found, ()
    return fit(model, table.rows(np.delete(table.order, rows))), tuple(map(int, found.table.numbered(rows)))


def told(numbers: tuple[int, ...], what: str = "poses", most: int | None = None) -> str:
    """Rows that stand out, the first `most` of them by their numbers."""
    listed = ", ".join(f"#{number}" for number in numbers[:most])
    more = f" and {len(numbers) - most} more" if most is not None and len(numbers) > most else ""
    who = f"{what.removesuffix('s')} stands" if len(numbers) == 1 else f"{what} stand"
    return f"{len(numbers)} {who} out: {listed}{more}"


def kept(found: Fit) -> str | None:
    """Gross outliers that a fit of all rows still holds, and what a person can do; None where there are none."""
    rows = gross(found)
    numbers = tuple(map(int, found.table.numbered(rows)))
    return f"{told(numbers)} {COUNTED}, still in this fit: {LEAVE_OUT}" if numbers else None


def caution(rows: tuple[int, ...]) -> str | None:
    """What was done about them, and what a person can do; None where there are none."""
    if not rows:
        return None
    return f"{told(rows)} {COUNTED}; left out of this fit as outliers: {LEAVE_OUT}"
