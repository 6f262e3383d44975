"""misalignment: find the directions of the x and y axes from the maximum of each output.

Excites   axis misalignment and non-orthogonality, scale factor, bias.
Blind to  the zero offset of beta, which looks like a rotation of the sensor about z; odd nonlinearity of high order.
Source    Ang IV; reversal, as for any level.

The output is flat at its maximum: 50 uV of noise at 1 V/g hides half a degree. So the procedure measures 90 deg to
each side of the maximum, where the slope of the output is greatest. Opposite loads have equal squares and products.
Even nonlinearity and cross-axis products therefore cancel in the difference. A narrower bracket would keep the
products.

A round has 16 poses. Beta rises through half a turn at alpha = 90 deg and falls through half a turn at -90 deg. Alpha
is searched at two angles of beta, 180 deg apart. So tilt of the stages, gear play and hysteresis have other signs than
the sensor's axes. The stage moves a quarter turn to every pose, so that friction slips fully. The signs follow each
other in time as + - - +, which removes drift.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from procedures.bounds import require_possible
from procedures.errors import ProcedureError, SettingError
from procedures.instruments import output_channel
from procedures.level_check import prepare
from procedures.session import Dwell, Pose, Session

ADAPTIVE = True
COARSE = "coarse"
TURN = "turn"  # of beta: brackets both axes
AXES = {"x": 0.0, "y": 90.0}  # beta, deg, at the maximum of an output without misalignment
QUARTER_DEG = 90.0
CENTRE_TOLERANCE_DEG = 1  # plus half for rounding: a cubic term of 0.4 % then gives an error of 0.006 deg
ROUND_POSES = 16
FEWEST_ROUNDS = 2  # one round has no scatter


@dataclass(frozen=True)
class Centre:
    """The centre of the brackets, whole degrees: beta at the maximum of x, and alpha - 90 at the maxima of x and y."""

    beta_deg: float = 0.0
    sag_deg: tuple[float, float] = (0.0, 0.0)


def misalignment(
    rig: Session, *, target_deg: float = 0.005, dwell_s: float = 5.0, settle_s: float = 0.5, most_rounds: int = 12
) -> None:
    """Bracket both maxima, centre the brackets, and repeat until the angles are known well enough.

    target_deg   The standard error of the angles to reach. It follows from the scatter of rounds about the same centre.
    most_rounds  The search ends after this number of rounds, also if the standard error is not reached.
    """
    if min(target_deg, dwell_s, most_rounds) <= 0 or settle_s < 0:
        raise SettingError("misalignment: target_deg, dwell_s, most_rounds must be above 0, settle_s must be 0 or more")
    require_possible(ROUND_POSES * most_rounds, "a smaller most_rounds")
    prepare(rig)
    _measure(rig, coarse_poses(), dwell_s, settle_s)
    centre = centre_of(extremes(_dwells(rig, COARSE)))
    rounds: list[NDArray[np.float64]] = []
    for number in range(1, most_rounds + 1):
        _measure(rig, round_poses(centre, number), dwell_s, settle_s)
        rounds.append(extremes(_dwells(rig, str(number))))
        if is_off(centre_of(np.mean(rounds, axis=0)), centre):
            centre, rounds = centre_of(rounds[-1]), []
        elif standard_error_deg(rounds) <= target_deg:
            return


def coarse_poses() -> Iterator[Pose]:
    """Six poses that give the rough directions of both axes for any mounting."""
    for beta_deg in (0.0, 90.0, 180.0, 270.0):
        yield Pose(90.0, beta_deg, 1, COARSE)
    for alpha_deg in (180.0, 0.0):
        yield Pose(alpha_deg, 270.0, 0, COARSE)


def round_poses(centre: Centre, number: int) -> Iterator[Pose]:
    """The poses of one round about `centre`."""
    for alpha_deg, direction, betas_deg in ((90.0, 1, (0, 90, 180, 270)), (-90.0, -1, (90, 0, -90, -180))):
        for beta_deg in betas_deg:
            yield Pose(alpha_deg, centre.beta_deg + beta_deg, direction, f"{TURN} {number}")
    for (axis, axis_deg), sag_deg in zip(AXES.items(), centre.sag_deg, strict=True):
        front_deg, path = centre.beta_deg + axis_deg, f"{axis} {number}"
        yield Pose(sag_deg, front_deg, 0, path)
        yield Pose(180 + sag_deg, front_deg, 0, path)
        yield Pose(180 - sag_deg, front_deg + 180, 0, path)
        yield Pose(-sag_deg, front_deg + 180, 0, path)


def extremes(dwells: Sequence[Dwell]) -> NDArray[np.float64]:
    """(beta - 0, alpha - 90) for x and (beta - 90, alpha - 90) for y at the maximum of each output, deg, shape (2, 2).

    A linear fit of the loads: in a round all other terms are orthogonal to them. Raises ProcedureError without x or y.
    """
    angles = []
    for axis, axis_deg in AXES.items():
        rows = [d for d in dwells if d.pose.path.split()[0] in (COARSE, TURN, axis)]
        channel = output_channel(axis, rows[0].means)
        if channel is None:
            raise ProcedureError(f"misalignment: the adc has no channel v{axis}; add it to channels in the bench file")
        a, b = np.radians([(d.pose.alpha_deg, d.pose.beta_deg) for d in rows]).T
        loads = np.column_stack([np.ones(len(rows)), np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)])
        _, x, y, z = np.linalg.lstsq(loads, [d.means[channel] for d in rows], rcond=None)[0]
        beta_deg, sag_deg = np.degrees([np.arctan2(y, x), -np.arctan2(z, np.hypot(x, y))])
        angles.append((_wrap(beta_deg - axis_deg), sag_deg))
    return np.array(angles)


def centre_of(extreme: NDArray[np.float64]) -> Centre:
    """The centre of brackets for these maxima. Both axes share beta."""
    (beta_x, sag_x), (beta_y, sag_y) = extreme.tolist()
    beta_deg = _wrap(beta_x + _wrap(beta_y - beta_x) / 2)
    return Centre(round(beta_deg), (round(sag_x), round(sag_y)))


def is_off(new: Centre, old: Centre) -> bool:
    """Whether `old` is too far from the `new` centre."""
    sags = [abs(a - b) for a, b in zip(new.sag_deg, old.sag_deg, strict=True)]
    return max(abs(_wrap(new.beta_deg - old.beta_deg)), *sags) > CENTRE_TOLERANCE_DEG


def standard_error_deg(rounds: Sequence[NDArray[np.float64]]) -> float:
    """Standard error of the mean of the rounds, deg, from their scatter pooled over all four angles.

    Infinite for fewer than FEWEST_ROUNDS.
    """
    if len(rounds) < FEWEST_ROUNDS:
        return float("inf")
    scatter = np.mean(np.var(rounds, axis=0, ddof=1))
    return float(np.sqrt(scatter / len(rounds)))


def _measure(rig: Session, poses: Iterator[Pose], dwell_s: float, settle_s: float) -> None:
    for pose in rig.missing(poses):
        _approach(rig, pose)
        rig.hold(pose, dwell_s, settle_s)


def _approach(rig: Session, pose: Pose) -> None:
    """Move to a quarter turn before `pose`: in beta for a turn of beta, to alpha = 90 deg for a search of alpha."""
    if pose.direction:
        rig.alpha.move_to(pose.alpha_deg)
        rig.beta.move_to(pose.beta_deg - pose.direction * QUARTER_DEG)
    else:
        rig.alpha.move_to(90.0)
        rig.beta.move_to(pose.beta_deg)


def _dwells(rig: Session, name: str) -> list[Dwell]:
    """The dwells of the coarse search, or of the round with the number `name`."""
    return [dwell for dwell in rig.measured() if dwell.pose.path.split()[-1] == name]


def _wrap(deg: float) -> float:
    """The same angle from -180 to 180 deg."""
    return (deg + 180) % 360 - 180
