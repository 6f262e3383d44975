"""Other readings of a table of poses: other angles or axes, rows that are shifted, a change in mid-run.

A reading corrects one mistake of a person, a cable or a stage: a wrong number of steps a turn, exchanged or reversed
angles, exchanged channels, a column pasted one row too low, a stage that lost steps. The module names a reading only if
its residual is a small part of that of the stated reading. Effects of a sensor pass: they follow the stated poses
better than any other reading.

Source  Chow, Econometrica 28 (1960): a linear response before a row and another one after it; Golub and Pereyra,
        SIAM J. Numer. Anal. 10 (1973): parameters that enter linearly are projected out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import scipy  # scipy.optimize loads slowly: it is imported at its first use

from calibrations.criteria import (
    EXCITED_G,
    EXPLAINED_BY_GEOMETRY,
    FAR_BETTER_GEOMETRY,
    FEWEST_RESPONSE_ROWS,
    FOLLOWS_GRAVITY,
    LEAST_RESPONSE_CHANGE,
    LEAST_STAGE_SCALE,
    LEAST_STAGE_ZERO_DEG,
    TURNED_DEG,
    UNTOUCHED_BY_READINGS,
)
from calibrations.discovery.verdict import Finding, Verdict
from calibrations.geometry.orientation import Pose, nominal_pose, reported_force, specific_force
from calibrations.means.noise import rms, white_std
from calibrations.table import AXES, Array, Table

SCALES = (0.1, 0.25, 0.5, 0.8, 0.9, 1.0, 1.1, 1.25, 2.0, 4.0, 10.0)  # where the search for a stage's scale begins
SHIFTS = (1, -1, 2, -2)  # rows
CHANGE_STEPS = 24  # between the rows at which a round of the search for a change looks
ENOUGH_ROWS = 2000  # for the start of a search of a stage's scale
COLUMNS = ("alpha_deg", "beta_deg")


@dataclass(frozen=True)
class Response:
    """Outputs as linear functions of the specific force: `slope` (axes, 3) in V/g, `share` (axes,) of the variance that
    it explains, `residual` (axes, n) in V."""

    slope: Array
    share: Array
    residual: Array


def response(outputs: Array, a: Array) -> Response:
    """The response of outputs (n, axes) to a specific force `a` (n, 3) in g, in the directions that it excites."""
    deviation = a - a.mean(axis=0)
    U, size, Vt = np.linalg.svd(deviation, full_matrices=False)
    excited = size > EXCITED_G * np.sqrt(len(a))
    centred = outputs - outputs.mean(axis=0)
    part = U[:, excited].T @ centred
    slope = (Vt[excited].T / size[excited]) @ part
    residual = centred - U[:, excited] @ part
    total = np.sum(centred**2, axis=0)
    share = 1 - np.sum(residual**2, axis=0) / np.where(total > 0, total, np.inf)
    return Response(slope.T, np.where(total > 0, share, 0.0), residual.T)


def geometry_finding(table: Table, stated_response: Response) -> Finding | None:
    """The geometry that explains the outputs better than the stated one; None if there is none."""
    if (reading := _find_better_columns(table, 1 - stated_response.share)) is not None:
        return Finding(Verdict.UNEXPLAINED, f"the outputs do not follow the poses as stated; they do if {reading}")
    explained = bool(np.all(stated_response.share >= EXPLAINED_BY_GEOMETRY))
    assignment = _assignment(table, stated_response, reported_force(table)) if explained else None
    if explained and (assignment is None or assignment.verdict is None):
        return assignment
    angle_readings = " or if ".join(_find_better_angles(table, stated_response, explained))
    if not angle_readings:
        return assignment
    if assignment is not None:
        return Finding(Verdict.UNEXPLAINED, f"{assignment.text}; the outputs fit as well if {angle_readings}")
    return Finding(Verdict.UNEXPLAINED, f"the outputs do not follow the poses as stated; they do if {angle_readings}")


def zero_doubt(table: Table, residual_share: float) -> str | None:
    """Stage zeros that are off by some degrees and explain the outputs far better than a fit; None if there are none.

    `residual_share`: residual share of variance after the fit, of the output for which it is largest. Each output
    follows its own axis here: a response to all axes would contain a turn of the sensor, as by a zero of beta.
    """
    if residual_share < UNTOUCHED_BY_READINGS:
        return None
    sample = _some_rows(table)
    size = np.maximum(sample.outputs.std(axis=0), np.finfo(float).tiny)

    def error(zeros_deg: Array) -> Array:
        moved = {name: sample.column(name) + zero for name, zero in zip(COLUMNS, zeros_deg, strict=True)}
        a = specific_force(nominal_pose(replace(sample, columns={**sample.columns, **moved})))
        own = [response(sample.outputs[:, [k]], a[:, [k]]).residual[0] / size[k] for k in range(len(size))]
        return np.concatenate(own)

    zeros_deg = scipy.optimize.least_squares(error, np.zeros(2), x_scale=10.0).x
    share = float(np.max(np.mean(error(zeros_deg).reshape(len(size), -1) ** 2, axis=1)))
    found = [_Angle(name, 1.0, float(zero)) for name, zero in zip(COLUMNS, zeros_deg, strict=True)]
    off = [_zero_text(angle) for angle in found if LEAST_STAGE_ZERO_DEG < abs(angle.zero_deg) < TURNED_DEG]
    if share > FAR_BETTER_GEOMETRY * residual_share or not off:
        return None
    return (
        f"the outputs follow the poses far better if {' and '.join(off)}; check the zero of the stage, the level of "
        "its base and the mount of the sensor, and add the offset to the column, or fit stage-zero-offset too"
    )


def _find_better_columns(table: Table, residual_shares: Array) -> str | None:
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
    limit = FAR_BETTER_GEOMETRY * stated_share
    return _check_angle_scale(table, limit) or _check_row_shift(table, limit) or _response_change(table, limit)


def _unexplained_share(outputs: Array, force: Array) -> Array:
    """Share of each output's variance that a linear response to the specific force does not explain, (axes,)."""
    return 1 - response(outputs, force).share


class _Angle(NamedTuple):
    """One angle, `scale` times the stated one plus `zero_deg`."""

    column: str
    scale: float
    zero_deg: float

    def force(self, table: Table) -> Array:
        """Specific force at the poses with this angle, g, shape (n, 3)."""
        angle = self.scale * table.column(self.column) + self.zero_deg
        return specific_force(nominal_pose(replace(table, columns={**table.columns, self.column: angle})))


def _check_angle_scale(table: Table, limit: float) -> str | None:
    """A stage angle with a wrong factor, or with a zero that is wrong by tens of degrees."""
    angles = []
    sample = _some_rows(table)
    for column in COLUMNS:
        if np.ptp(table.column(column)) == 0:
            continue
        shifted = _refine_angle(_Angle(column, 1.0, 0.0), table, free_scale=False)
        starts = [_best_zero(column, scale, sample) for scale in SCALES]
        start = starts[int(np.argmin([_worst_share(angle, sample) for angle in starts]))]
        scaled = _refine_angle(start, table, free_scale=True)
        angles += [(_worst_share(shifted, table), shifted), (_worst_share(scaled, table), scaled)]
    angles = [(share, angle) for share, angle in angles if share <= limit]
    zeros = [item for item in angles if item[1].scale == 1.0 and abs(item[1].zero_deg) > TURNED_DEG]
    unscaled = [item for item in angles if item[1].scale == 1.0]
    scales = [item for item in angles if abs(item[1].scale - 1) > LEAST_STAGE_SCALE]
    if zeros:
        return f"{_zero_text(min(zeros)[1])}; check the zero of the stage and add it to the column"
    if scales and not unscaled and min(scales)[0] < _by_sensor(table):
        angle = min(scales)[1]
        return (
            f"{angle.column} is multiplied by {angle.scale:.4g}; check the steps for a turn, the gear ratio and the "
            "unit of this stage"
        )
    return None


def _zero_text(angle: _Angle) -> str:
    return f"the zero of {angle.column} is {angle.zero_deg:+.3g} deg off"


def _some_rows(table: Table) -> Table:
    """Rows drawn at random, since a fixed step could fall on the same angles each time; all rows of a short table."""
    if table.n <= ENOUGH_ROWS:
        return table
    row_numbers = np.random.default_rng(0).choice(table.n, ENOUGH_ROWS, replace=False)
    return table.rows(np.sort(row_numbers))


def _by_sensor(table: Table) -> float:
    """The least residual share of variance after a nonlinear response of one mechanism at the stated poses.

    A scale factor that changes with the third axis resembles an angle with a wrong scale of half a percent.
    """
    force = reported_force(table)
    x, y, z = force[:, 0], force[:, 1], force[:, 2]
    mechanisms: list[list[Array]] = [
        [x**2, x**3, y**2, y**3, np.abs(x), np.abs(y)],
        [z**2, z**3],
        [x * z, x * z**2, y * z, y * z**2],
        [x * y, x * y**2, y * x**2],
    ]
    inputs = [np.column_stack([force, *terms]) for terms in mechanisms]
    return min(float(np.max(_unexplained_share(table.outputs, driver))) for driver in inputs)


def _best_zero(column: str, scale: float, table: Table) -> _Angle:
    """The best zero for a scale, in steps of 30 deg."""
    zeros = [0.0] if scale == 1.0 else (np.arange(-5, 7) * 30.0).tolist()
    angles = [_Angle(column, scale, zero) for zero in zeros]
    return angles[int(np.argmin([_worst_share(angle, table) for angle in angles]))]


def _worst_share(angle: _Angle, table: Table) -> float:
    return float(np.max(_unexplained_share(table.outputs, angle.force(table))))


def _refine_angle(angle: _Angle, table: Table, *, free_scale: bool) -> _Angle:
    """The scale and zero of least residual, by least squares from these."""
    size = table.outputs.std(axis=0)
    reach = float(np.max(np.abs(table.column(angle.column))))

    def shifted(step: Array) -> _Angle:
        """A step of 1 moves the farthest angle by 1 deg."""
        scale = angle.scale + (step[1] / reach if free_scale else 0.0)
        return _Angle(angle.column, float(scale), float(angle.zero_deg + step[0]))

    def error(step: Array) -> Array:
        return np.ravel(response(table.outputs, shifted(step).force(table)).residual.T / size)

    return shifted(scipy.optimize.least_squares(error, np.zeros(2 if free_scale else 1), x_scale=10.0, max_nfev=30).x)


def _check_row_shift(table: Table, limit: float) -> str | None:
    """One output, or all outputs, in another row than their pose."""
    force = reported_force(table)
    names = table.output_names
    for shift in SHIFTS:
        overlap = slice(max(-shift, 0), table.n - max(shift, 0))
        shifted_outputs = np.roll(table.outputs, -shift, axis=0)
        displacement = f"{abs(shift)} row{'s' if abs(shift) > 1 else ''} too {'late' if shift > 0 else 'early'}"
        shifted_shares = _unexplained_share(shifted_outputs[overlap], force[overlap])
        if np.max(shifted_shares) <= limit:
            return f"the outputs are {displacement} in the file; shift their columns, or those of the angles"
        stated_shares = _unexplained_share(table.outputs[overlap], force[overlap])
        for k, name in enumerate(names):
            if shifted_shares[k] <= limit and np.max(np.delete(stated_shares, k), initial=0.0) <= limit:
                return f"{name} is {displacement} in the file; shift this column"
    return None


def _response_change(table: Table, limit: float) -> str | None:
    """A row at which the linear response of the outputs changes."""
    columns = np.column_stack([np.ones(table.n), reported_force(table)])
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


def _find_better_angles(table: Table, stated_response: Response, explained: bool) -> list[str]:
    """Readings of the angle columns by which each output follows its own axis, unlike by the stated ones."""
    texts = []
    for text, pose in _angle_readings(nominal_pose(table)).items():
        a = specific_force(pose)
        candidate = response(table.outputs, a)
        far_better = np.max(1 - candidate.share) <= FAR_BETTER_GEOMETRY * np.max(1 - stated_response.share)
        if (
            np.all(candidate.share >= EXPLAINED_BY_GEOMETRY)
            and (explained or far_better)
            and _assignment(table, candidate, a) is None
        ):
            texts.append(text)
    return texts


def _angle_readings(pose: Pose) -> Mapping[str, Pose]:
    """Other meanings of the angles, in words."""

    def with_angles(alpha: Array, beta: Array) -> Pose:
        return Pose(alpha, beta, pose.mount, pose.flip, pose.up)

    return MappingProxyType(
        {
            "the columns alpha_deg and beta_deg are exchanged": with_angles(pose.beta, pose.alpha),
            "beta counts backwards (change the sign of beta_deg)": with_angles(pose.alpha, -pose.beta),
            "alpha counts backwards (change the sign of alpha_deg)": with_angles(-pose.alpha, pose.beta),
            "alpha is counted from the horizontal (take 90 - alpha_deg)": with_angles(
                np.pi / 2 - pose.alpha, pose.beta
            ),
            "the angles are in radians": with_angles(np.degrees(pose.alpha), np.degrees(pose.beta)),
        }
    )


def _assignment(table: Table, stated_response: Response, a: Array) -> Finding | None:
    """Outputs that do not follow their own axes, or follow them backwards; None if there are none."""
    centred = a - a.mean(axis=0)
    eigen = np.linalg.eigh(centred.T @ centred / table.n)
    excited_directions = eigen[1][:, eigen[0] > EXCITED_G**2]
    projector = excited_directions @ excited_directions.T
    excited_axes = projector[: len(stated_response.slope)]  # excited part of each axis
    size = np.linalg.norm(stated_response.slope, axis=1)
    if not size.max() > 0:
        return None
    reach = np.linalg.norm(excited_axes, axis=1)
    responding = [k for k in range(len(size)) if stated_response.share[k] >= FOLLOWS_GRAVITY and size[k] > 0]
    cosine = {
        k: float(stated_response.slope[k] @ excited_axes[k] / size[k] / reach[k]) for k in responding if reach[k] > 0.5
    }
    limit = np.cos(np.radians(TURNED_DEG))
    astray = [k for k, c in cosine.items() if abs(c) < limit]
    astray += [k for k in responding if k not in cosine and size[k] > 0.5 * size.max()]
    if astray:
        return Finding(Verdict.UNEXPLAINED, _astray(table, stated_response, astray))
    reversed_ = [k for k, c in cosine.items() if c < 0]
    if not reversed_:
        return None
    names = " and ".join(AXES[k] for k in reversed_)
    if len(reversed_) == len(cosine) or (len(cosine) > 2 and reversed_ == [0, 1]):
        return Finding(
            None,
            f"the scale factor of {names} is negative: the sensor may be turned by 180 deg on the stage; if it is, "
            "state mount_deg = 180; if not, check the sign of alpha_deg and the wiring",
        )
    return Finding(
        None,
        f"the scale factor of {names} is negative and that of the others is positive: beta counts "
        "backwards (change the sign of beta_deg), the sensor is mounted face down (state flip = 1), or the output of "
        f"{names} is inverted",
    )


def _astray(table: Table, stated_response: Response, rows: list[int]) -> str:
    """The axis that each output follows, and a hint on the wiring to check."""
    follow = []
    for k in rows:
        slope = stated_response.slope[k]
        axis = int(np.argmax(np.abs(slope)))
        if abs(slope[axis]) > np.cos(np.radians(TURNED_DEG)) * np.linalg.norm(slope):
            follow.append(f"{table.output_names[k]} follows gravity along {'-' if slope[axis] < 0 else ''}{AXES[axis]}")
        else:
            angle = float(np.degrees(np.arctan2(slope[1 - k], slope[k]))) if k < 2 else 0.0
            follow.append(f"{table.output_names[k]} follows gravity {abs(angle):.0f} deg away from {AXES[k]}")
    swapped = (
        len(rows) == 2 and rows == [0, 1] and np.argmax(np.abs(stated_response.slope[:2]), axis=1).tolist() == [1, 0]
    )
    exchanged = swapped and stated_response.slope[0, 1] * stated_response.slope[1, 0] > 0
    remedy = (
        f"the channels are exchanged: exchange the columns {' and '.join(table.output_names[:2])}, or the channels in "
        "the bench file"
        if exchanged
        else "check how the sensor is mounted on the stage (mount_deg) and the assignment of the channels"
    )
    return f"{' and '.join(follow)}; {remedy}"
