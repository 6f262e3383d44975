"""Other readings of a table of poses: angles by another scale or zero, rows that are shifted, a change in mid-run.

Each is one mistake of a person, a cable or a stage that a table cannot state: steps of a turn that are set wrongly, a
column that is pasted one row too low, a stage that lost steps. A reading is named only if it leaves a small part of
what the stated one leaves; effects of a sensor stay, as they follow the stated poses better than any of these.

Source  Chow, Econometrica 28 (1960): a linear response before a row and another one from it on; Golub and Pereyra,
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
COLUMNS = ("alpha_deg", "beta_deg")


def other_reading(table: Table, shares_left: Array) -> str | None:
    """The reading of the table that explains its outputs far better, as what to check; None where there is none.

    `shares_left`: of the variance of each output, what a linear response at the stated poses leaves, shape (axes,).
    """
    if not np.all(table.outputs.std(axis=0) > 0):
        return None
    before = float(np.max(shares_left))
    noise = white_std(table)
    floor = UNTOUCHED_BY_READINGS if noise is None else 9 * float(np.max(rms(noise.T) ** 2 / np.var(table.outputs, 0)))
    if before < max(floor, UNTOUCHED_BY_READINGS) or table.n < 2 * FEWEST_RESPONSE_ROWS:
        return None
    limit = min(FAR_BETTER_GEOMETRY * before, 1 - EXPLAINED_BY_GEOMETRY)
    return _scaled(table, limit) or _shifted(table, limit) or _changed(table, limit)


def _left(force: Array, outputs: Array) -> Array:
    """Share of the variance of each output that a linear response to the specific force leaves, shape (axes,)."""
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
    """A stage whose angle is off by a factor, or by a zero of tens of degrees."""
    found = []
    for column in COLUMNS:
        if np.ptp(table.column(column)) == 0:
            continue
        shifted = _refined(_Angle(column, 1.0, 0.0), table, free_scale=False)
        begins = [_best_zero(column, scale, table) for scale in SCALES]
        begin = begins[int(np.argmin([_worst(angle, table) for angle in begins]))]
        scaled = _refined(begin, table, free_scale=True)
        found += [(_worst(shifted, table), shifted), (_worst(scaled, table), scaled)]
    found = [(left, a) for left, a in found if left <= limit]
    zeros = [each for each in found if each[1].scale == 1.0 and abs(each[1].zero_deg) > TURNED_DEG]
    plain = [each for each in found if each[1].scale == 1.0]
    scales = [each for each in found if abs(each[1].scale - 1) > LEAST_STAGE_SCALE]
    if zeros:
        a = min(zeros)[1]
        return (
            f"the zero of {a.column} is {a.zero_deg:+.3g} deg off; check the zero of the stage and add it to the column"
        )
    if scales and not plain and min(scales)[0] < _by_sensor(table):
        a = min(scales)[1]
        return (
            f"{a.column} is multiplied by {a.scale:.4g}; check the steps for a turn, the gear ratio and the unit of "
            "this stage"
        )
    return None


def _by_sensor(table: Table) -> float:
    """The least share of variance that a nonlinear response of one mechanism leaves at the stated poses.

    A scale factor that changes with the third axis resembles an angle that is off by half a percent.
    """
    a = specific_force(nominal_pose(table))
    own, other, z = a[:, 0], a[:, 1], a[:, 2]
    mechanisms: list[list[Array]] = [
        [own**2, own**3, other**2, other**3, np.abs(own), np.abs(other)],
        [z**2, z**3],
        [own * z, own * z**2, other * z, other * z**2],
        [own * other, own * other**2, other * own**2],
    ]
    return min(float(np.max(_left(np.column_stack([a, *more]), table.outputs))) for more in mechanisms)


def _best_zero(column: str, scale: float, table: Table) -> _Angle:
    """The zero, of every 30 deg, that goes with a scale."""
    zeros = [0.0] if scale == 1.0 else (np.arange(-5, 7) * 30.0).tolist()
    angles = [_Angle(column, scale, zero) for zero in zeros]
    return angles[int(np.argmin([_worst(angle, table) for angle in angles]))]


def _worst(angle: _Angle, table: Table) -> float:
    return float(np.max(_left(angle.force(table), table.outputs)))


def _refined(angle: _Angle, table: Table, *, free_scale: bool) -> _Angle:
    """The scale and zero nearby that leave least."""
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
    """Outputs, one or all of them, that belong to the pose of another row."""
    force = specific_force(nominal_pose(table))
    names = table.output_names
    for shift in SHIFTS:
        kept = slice(max(-shift, 0), table.n - max(shift, 0))
        moved = np.roll(table.outputs, -shift, axis=0)
        way = f"{abs(shift)} row{'s' if abs(shift) > 1 else ''} too {'late' if shift > 0 else 'early'}"
        every = _left(force[kept], moved[kept])
        if np.max(every) <= limit:
            return f"the outputs stand {way} in the file; shift their columns, or those of the angles"
        own = _left(force[kept], table.outputs[kept])
        for k, name in enumerate(names):
            if every[k] <= limit and np.max(np.delete(own, k), initial=0.0) <= limit:
                return f"{name} stands {way} in the file; shift this column"
    return None


def _changed(table: Table, limit: float) -> str | None:
    """A row from which on the outputs follow another linear response."""
    columns = np.column_stack([np.ones(table.n), specific_force(nominal_pose(table))])
    outputs = (table.outputs - table.outputs.mean(axis=0)) / table.outputs.std(axis=0)
    least, most = FEWEST_RESPONSE_ROWS, table.n - FEWEST_RESPONSE_ROWS
    if most <= least:
        return None
    coarse = range(least, most, max(1, (most - least) // 24))
    best = min(coarse, key=lambda k: _of_parts(columns, outputs, k)[0])
    near = range(max(least, best - coarse.step), min(most, best + coarse.step) + 1)
    best = min(near, key=lambda k: _of_parts(columns, outputs, k)[0])
    left, change = _of_parts(columns, outputs, best)
    if left > limit or change < LEAST_RESPONSE_CHANGE:
        return None
    number = int(table.numbered(np.array([best]))[0])
    return (
        f"the rows from #{number} on (counted from 0) follow another response than those before: the stage lost steps, "
        "the sensor moved on its mount, or these are two sensors; analyse the two parts separately, or measure again"
    )


def _of_parts(columns: Array, outputs: Array, k: int) -> tuple[float, float]:
    """(share of the variance that two responses leave, change of the slopes as far as both parts excite them).

    No change where a part lacks a direction.
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
