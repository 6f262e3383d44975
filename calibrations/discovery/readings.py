"""Other readings of a table of poses: angles by another scale or zero, rows that are shifted, a change in mid-run.

A reading corrects one mistake of a person, a cable or a stage: a wrong number of steps a turn, a column pasted one row
too low, a stage that lost steps. The module names a reading only if its residual is a small part of that of the stated
reading. Effects of a sensor pass: they follow the stated poses better than any other reading.

Source  Chow, Econometrica 28 (1960): a linear response before a row and another one after it; Golub and Pereyra,
        SIAM J. Numer. Anal. 10 (1973): parameters that enter linearly are projected out.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy  # its room of optimization is loaded where it is first entered

from calibrations.criteria import (
    EXCITED_G,
    EXPLAINED_BY_GEOMETRY,
    FAR_BETTER_GEOMETRY,
    FEWEST_RESPONSE_ROWS,
    LEAST_RESPONSE_CHANGE,
    LEAST_STAGE_SCALE,
    TURNED_DEG,
    UNTOUCHED_BY_READINGS,
)
from calibrations.geometry.orientation import nominal_pose, specific_force
from calibrations.means.noise import rms, white_std
from calibrations.table import Array, Table

SCALES = (0.1, 0.25, 0.5, 0.8, 0.9, 1.0, 1.1, 1.25, 2.0, 4.0, 10.0)  # where the search for a stage's scale begins
SHIFTS = (1, -1, 2, -2)  # rows
CHANGE_STEPS = 24  # between the rows at which a round of the search for a change looks
ENOUGH_ROWS = 2000  # for the start of a search of a stage's scale
COLUMNS = ("alpha_deg", "beta_deg")


def other_reading(table: Table, residual_shares: Array) -> str | None:
    """The reading of the table that explains its outputs far better, with a check to make; None if there is none.

    `residual_shares`: residual share of each output's variance after a linear response at the stated poses, (axes,).
    """
    if not np.all(table.outputs.std(axis=0) > 0):
        return None
    stated_share = float(np.max(residual_shares))
    noise = white_std(table)
    floor = UNTOUCHED_BY_READINGS if noise is None else 9 * float(np.max(rms(noise.T) ** 2 / np.var(table.outputs, 0)))
    if stated_share < max(floor, UNTOUCHED_BY_READINGS) or table.n < 2 * FEWEST_RESPONSE_ROWS:
        return None
    limit = min(FAR_BETTER_GEOMETRY * stated_share, 1 - EXPLAINED_BY_GEOMETRY)
    return _scaled(table, limit) or _shifted(table, limit) or _changed(table, limit)


def _residual_share(force: Array, outputs: Array) -> Array:
    """Residual share of each output's variance after a linear response to the specific force, shape (axes,)."""
    residual = _residual(force, outputs)
    return np.asarray(np.sum(residual**2, axis=0) / np.maximum(outputs.var(axis=0) * len(outputs), 1e-300))


def _residual(force: Array, outputs: Array) -> Array:
    about, centred = force - force.mean(axis=0), outputs - outputs.mean(axis=0)
    U, size, _ = np.linalg.svd(about, full_matrices=False)
    U = U[:, size > EXCITED_G * np.sqrt(len(about))]
    return np.asarray(centred - U @ (U.T @ centred))


class _Angle(NamedTuple):
    """One angle, `scale` times the stated one plus `zero_deg`."""

    column: str
    scale: float
    zero_deg: float

    def force(self, table: Table) -> Array:
        """Specific force at the poses with this angle, g, shape (n, 3)."""
        angle = self.scale * table.column(self.column) + self.zero_deg
        return specific_force(nominal_pose(replace(table, columns={**table.columns, self.column: angle})))


def _scaled(table: Table, limit: float) -> str | None:
    """A stage angle with a wrong factor, or with a zero that is wrong by tens of degrees."""
    angles = []
    some = _some_rows(table)
    for column in COLUMNS:
        if np.ptp(table.column(column)) == 0:
            continue
        shifted = _refined(_Angle(column, 1.0, 0.0), table, free_scale=False)
        starts = [_best_zero(column, scale, some) for scale in SCALES]
        start = starts[int(np.argmin([_worst_share(angle, some) for angle in starts]))]
        scaled = _refined(start, table, free_scale=True)
        angles += [(_worst_share(shifted, table), shifted), (_worst_share(scaled, table), scaled)]
    angles = [(share, angle) for share, angle in angles if share <= limit]
    zeros = [item for item in angles if item[1].scale == 1.0 and abs(item[1].zero_deg) > TURNED_DEG]
    unscaled = [item for item in angles if item[1].scale == 1.0]
    scales = [item for item in angles if abs(item[1].scale - 1) > LEAST_STAGE_SCALE]
    if zeros:
        angle = min(zeros)[1]
        return (
            f"the zero of {angle.column} is {angle.zero_deg:+.3g} deg off; check the zero of the stage and add it to "
            "the column"
        )
    if scales and not unscaled and min(scales)[0] < _by_sensor(table):
        angle = min(scales)[1]
        return (
            f"{angle.column} is multiplied by {angle.scale:.4g}; check the steps for a turn, the gear ratio and the "
            "unit of this stage"
        )
    return None


def _some_rows(table: Table) -> Table:
    """Rows drawn at random, since a fixed step could fall on the same angles each time; all rows of a short table."""
    if table.n <= ENOUGH_ROWS:
        return table
    drawn = np.random.default_rng(0).choice(table.n, ENOUGH_ROWS, replace=False)
    return table.rows(np.sort(drawn))


def _by_sensor(table: Table) -> float:
    """The least residual share of variance after a nonlinear response of one mechanism at the stated poses.

    A scale factor that changes with the third axis resembles an angle with a wrong scale of half a percent.
    """
    force = specific_force(nominal_pose(table))
    x, y, z = force[:, 0], force[:, 1], force[:, 2]
    mechanisms: list[list[Array]] = [
        [x**2, x**3, y**2, y**3, np.abs(x), np.abs(y)],
        [z**2, z**3],
        [x * z, x * z**2, y * z, y * z**2],
        [x * y, x * y**2, y * x**2],
    ]
    return min(float(np.max(_residual_share(np.column_stack([force, *terms]), table.outputs))) for terms in mechanisms)


def _best_zero(column: str, scale: float, table: Table) -> _Angle:
    """The best zero for a scale, in steps of 30 deg."""
    zeros = [0.0] if scale == 1.0 else (np.arange(-5, 7) * 30.0).tolist()
    angles = [_Angle(column, scale, zero) for zero in zeros]
    return angles[int(np.argmin([_worst_share(angle, table) for angle in angles]))]


def _worst_share(angle: _Angle, table: Table) -> float:
    return float(np.max(_residual_share(angle.force(table), table.outputs)))


def _refined(angle: _Angle, table: Table, *, free_scale: bool) -> _Angle:
    """The scale and zero of least residual, by least squares from these."""
    size = table.outputs.std(axis=0)
    reach = float(np.max(np.abs(table.column(angle.column))))

    def moved(step: Array) -> _Angle:
        """A step of 1 moves the farthest angle by 1 deg."""
        scale = angle.scale + (step[1] / reach if free_scale else 0.0)
        return _Angle(angle.column, float(scale), float(angle.zero_deg + step[0]))

    def error(step: Array) -> Array:
        return np.ravel(_residual(moved(step).force(table), table.outputs) / size)

    return moved(scipy.optimize.least_squares(error, np.zeros(2 if free_scale else 1), x_scale=10.0, max_nfev=30).x)


def _shifted(table: Table, limit: float) -> str | None:
    """One output, or all outputs, in another row than their pose."""
    force = specific_force(nominal_pose(table))
    names = table.output_names
    for shift in SHIFTS:
        overlap = slice(max(-shift, 0), table.n - max(shift, 0))
        moved = np.roll(table.outputs, -shift, axis=0)
        displacement = f"{abs(shift)} row{'s' if abs(shift) > 1 else ''} too {'late' if shift > 0 else 'early'}"
        shifted_shares = _residual_share(force[overlap], moved[overlap])
        if np.max(shifted_shares) <= limit:
            return f"the outputs stand {displacement} in the file; shift their columns, or those of the angles"
        stated_shares = _residual_share(force[overlap], table.outputs[overlap])
        for k, name in enumerate(names):
            if shifted_shares[k] <= limit and np.max(np.delete(stated_shares, k), initial=0.0) <= limit:
                return f"{name} stands {displacement} in the file; shift this column"
    return None


def _changed(table: Table, limit: float) -> str | None:
    """A row at which the linear response of the outputs changes."""
    columns = np.column_stack([np.ones(table.n), specific_force(nominal_pose(table))])
    outputs = (table.outputs - table.outputs.mean(axis=0)) / table.outputs.std(axis=0)
    first, last = FEWEST_RESPONSE_ROWS, table.n - FEWEST_RESPONSE_ROWS
    if last <= first:
        return None
    rows = range(first, last, max(1, (last - first) // CHANGE_STEPS))
    best = min(rows, key=lambda k: _two_responses(columns, outputs, k)[0])
    while rows.step > 1:  # about the best row, ever finer
        finer = max(1, rows.step // CHANGE_STEPS)
        rows = range(max(first, best - rows.step), min(last, best + rows.step) + 1, finer)
        best = min(rows, key=lambda k: _two_responses(columns, outputs, k)[0])
    share, change = _two_responses(columns, outputs, best)
    if share > limit or change < LEAST_RESPONSE_CHANGE:
        return None
    number = int(table.numbered(np.array([best]))[0])
    return (
        f"the rows from #{number} on (counted from 0) follow another response than those before: the stage lost steps, "
        "the sensor moved on its mount, or these are two sensors; analyse the two parts separately, or measure again"
    )


def _two_responses(columns: Array, outputs: Array, k: int) -> tuple[float, float]:
    """(residual share of variance with two responses, change of the slopes that both parts excite).

    The change is 0 if a part lacks a direction.
    """
    answers, squares, ranks = [], 0.0, []
    for rows in (slice(None, k), slice(k, None)):
        answer, _, rank, _ = np.linalg.lstsq(columns[rows], outputs[rows], rcond=EXCITED_G)
        squares = squares + np.sum((outputs[rows] - columns[rows] @ answer) ** 2, axis=0)
        answers.append(answer)
        ranks.append(int(rank))
    change = 0.0
    directions = int(np.linalg.matrix_rank(columns, tol=EXCITED_G * np.linalg.norm(columns, 2)))
    if ranks[0] == ranks[1] == directions > 1:  # at one orientation no slope is known
        excited = np.minimum(columns[:k, 1:].std(axis=0), columns[k:, 1:].std(axis=0))[:, None]
        slopes = [excited * answer[1:] for answer in answers]
        change = float(np.linalg.norm(slopes[1] - slopes[0]) / np.linalg.norm(slopes[0]))
    return float(np.max(squares)) / len(columns), change
