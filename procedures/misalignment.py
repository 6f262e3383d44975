"""misalignment: search for the greatest output of x and of y: where the axes point.

Excites   axis misalignment and non-orthogonality, scale factor, bias.
Blind to  the zero of beta, which looks as a turn of the sensor about z; odd nonlinearity of higher order.
Source    Ang IV; reversal, as for any level.

The extreme is flat: 50 uV of noise at 1 V/g hide half a degree of it. So each is bracketed symmetrically by 90 deg to
either side, where the output is steepest. Opposite loads have equal squares and products, so that even nonlinearity
and cross-axis products drop out of their difference; narrower brackets would keep the products.

A round is 16 poses. Half a turn of beta is done up at alpha = 90 and down at -90, and alpha is searched with the
sensor facing either way: errors of the stages' levels, gear play and hysteresis have other signs than the sensor's
axes. Every pose is reached over the quarter turn before it, so that friction slips fully. In time the signs follow
each other as + - - +, which takes out drift.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from procedures.errors import ProcedureError, SettingError
from procedures.level_check import levelled
from procedures.session import Dwell, Pose, Session

ADAPTIVE = True
COARSE = "coarse"
TURN = "turn"  # of beta: brackets both axes
AXES = {"x": 0.0, "y": 90.0}  # beta at which each is at its extreme, on a sensor that is not misaligned
QUARTER_DEG = 90.0
CENTRED_DEG = 1  # and half for rounding: a cubic term of 0.4 % then errs by 0.006 deg
FEWEST_ROUNDS = 2  # below which nothing tells how well they agree


@dataclass(frozen=True)
class Centre:
    """What the brackets stand about, whole degrees: beta at the extreme of x, and alpha - 90 at those of x and y."""

    beta_deg: float = 0.0
    sag_deg: tuple[float, float] = (0.0, 0.0)


def misalignment(
    rig: Session, *, target_deg: float = 0.005, dwell_s: float = 5.0, settle_s: float = 0.5, most_rounds: int = 12
) -> None:
    """Bracket both extremes, centre the brackets, and repeat until the angles are known to `target_deg`.

    `target_deg` is the standard error by which rounds about one centre agree; after `most_rounds` the search ends
    whether it is reached or not.
    """
    if min(target_deg, dwell_s, most_rounds) <= 0 or settle_s < 0:
        raise SettingError("misalignment: target_deg, dwell_s and most_rounds must be above 0, settle_s not below")
    rig.confirm("mounting", "Is the sensor mounted face up on the table, its cable free to turn?", drawing="face-up")
    levelled(rig)
    _measure(rig, coarse(), dwell_s, settle_s)
    centre = centred(extremes(_of(rig, COARSE)))
    found: list[NDArray[np.float64]] = []
    for number in range(1, most_rounds + 1):
        _measure(rig, around(centre, number), dwell_s, settle_s)
        found.append(extremes(_of(rig, str(number))))
        if is_off(centred(np.mean(found, axis=0)), centre):
            centre, found = centred(found[-1]), []
        elif standard_error_deg(found) <= target_deg:
            return


def coarse() -> Iterator[Pose]:
    """Six poses that say roughly where both axes point, whichever way the sensor lies."""
    for beta_deg in (0.0, 90.0, 180.0, 270.0):
        yield Pose(90.0, beta_deg, 1, COARSE)
    for alpha_deg in (180.0, 0.0):
        yield Pose(alpha_deg, 270.0, 0, COARSE)


def around(centre: Centre, number: int) -> Iterator[Pose]:
    """The poses of one round."""
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
    """(beta - 0, alpha - 90) for x and (beta - 90, alpha - 90) for y at the greatest output, deg, shape (2, 2).

    A straight fit of the loads: in a round, all else is orthogonal to them. Raises ProcedureError without x and y.
    """
    found = []
    for axis, axis_deg in AXES.items():
        rows = [d for d in dwells if d.pose.path.split()[0] in (COARSE, TURN, axis)]
        if any(f"v{axis}" not in d.means for d in rows):
            raise ProcedureError(f"misalignment: the adc has no channel v{axis}; name it in the bench file's channels")
        a, b = np.radians([(d.pose.alpha_deg, d.pose.beta_deg) for d in rows]).T
        loads = np.column_stack([np.ones(len(rows)), np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)])
        _, x, y, z = np.linalg.lstsq(loads, [d.means[f"v{axis}"] for d in rows], rcond=None)[0]
        beta_deg, sag_deg = np.degrees([np.arctan2(y, x), -np.arctan2(z, np.hypot(x, y))])
        found.append((_wrapped(beta_deg - axis_deg), sag_deg))
    return np.array(found)


def centred(extreme: NDArray[np.float64]) -> Centre:
    """The centre of brackets for these extremes; beta is shared by both axes."""
    (beta_x, sag_x), (beta_y, sag_y) = extreme.tolist()
    beta_deg = _wrapped(beta_x + _wrapped(beta_y - beta_x) / 2)
    return Centre(round(beta_deg), (round(sag_x), round(sag_y)))


def is_off(new: Centre, old: Centre) -> bool:
    """Whether brackets about `old` are too far from centred."""
    sags = [abs(a - b) for a, b in zip(new.sag_deg, old.sag_deg, strict=True)]
    return max(abs(_wrapped(new.beta_deg - old.beta_deg)), *sags) > CENTRED_DEG


def standard_error_deg(rounds: Sequence[NDArray[np.float64]]) -> float:
    """Of the mean over rounds, from their scatter, pooled over all four angles; infinite where it is not known."""
    if len(rounds) < FEWEST_ROUNDS:
        return float("inf")
    scatter = np.mean(np.var(rounds, axis=0, ddof=1))
    return float(np.sqrt(scatter / len(rounds)))


def _measure(rig: Session, poses: Iterator[Pose], dwell_s: float, settle_s: float) -> None:
    for pose in rig.missing(poses):
        _approach(rig, pose)
        rig.hold(pose, dwell_s, settle_s)


def _approach(rig: Session, pose: Pose) -> None:
    """Stand a quarter turn before `pose`: in beta for a turn of beta; at alpha = 90 for a search of alpha."""
    if pose.direction:
        rig.alpha.move_to(pose.alpha_deg)
        rig.beta.move_to(pose.beta_deg - pose.direction * QUARTER_DEG)
    else:
        rig.alpha.move_to(90.0)
        rig.beta.move_to(pose.beta_deg)


def _of(rig: Session, what: str) -> list[Dwell]:
    """What the record holds of the coarse search, or of one round."""
    return [dwell for dwell in rig.measured() if dwell.pose.path.split()[-1] == what]


def _wrapped(deg: float) -> float:
    """Within half a turn of 0."""
    return (deg + 180) % 360 - 180
