"""sweep: hold the sensor at a grid of stage angles, in both directions of beta.

Excites   scale factor, bias, cross-axis effects, misalignment, hysteresis, stage errors.
Blind to  ageing, which it cannot separate from temperature; the output filter.
Source    Ang III.A; the inclinations are out of order, so that inclination and time are not correlated.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal

from procedures.bounds import require_possible
from procedures.errors import SettingError
from procedures.level_check import check_level, prepare
from procedures.pose_list import parse_poses
from procedures.session import Pose, Session

HALF_TURN_DEG = 180.0
INCLINATIONS_DEG = (90.0, 30.0, 150.0, 60.0, 120.0, 45.0, 135.0)
REFERENCE = Pose(90.0, 45.0, 1, "reference")  # both axes feel gravity; beta always rises to it
Paths = Literal["grid", "ang"]
Face = Literal["up", "down", "both"]
FEWER = "a larger step_deg, or fewer inclinations_deg"
NOT_A_STEP = "sweep: step_deg is {:g}; give a step that divides 180 deg, such as 10"
FLIPS = {"up": (0,), "down": (1,), "both": (0, 1)}


def sweep(
    rig: Session,
    *,
    inclinations_deg: tuple[float, ...] = INCLINATIONS_DEG,
    step_deg: float = 10.0,
    dwell_s: float = 5.0,
    settle_s: float = 0.5,
    paths: Paths = "grid",
    reference_every: int = 0,
    face: Face = "up",
    pose_list: tuple[str, ...] = (),
) -> None:
    """Record the mean at every angle of a grid, with beta rising, then falling.

    inclinations_deg  The angles of alpha, in this order. Beta makes a full turn and back at each.
    step_deg          The step of beta. It divides 180.
    paths             grid: a full turn and back at each inclination. ang: also the negative of every inclination, and
                      half turns to each side at 90 deg.
    reference_every   The number of poses between two reference poses, which separate drift from the other effects;
                      0: no reference poses.
    face              The side of the sensor that is up. both: a person turns the sensor over half way, which separates
                      errors of the sensor from errors of the stages.
    pose_list         A CSV file with all poses in order, in place of a grid; rig plan sweep --optimal writes one.
    """
    if dwell_s <= 0 or settle_s < 0:
        raise SettingError(f"sweep: dwell_s is {dwell_s:g} and settle_s is {settle_s:g}; give times above 0")
    if reference_every < 0:
        raise SettingError(f"sweep: reference_every is {reference_every}; give a number of poses, or 0 for none")
    if pose_list and (reference_every or face != "up"):
        raise SettingError("sweep: pose_list has all poses; use reference_every and face without pose_list only")
    if pose_list:
        poses = parse_poses(pose_list)
    else:
        require_possible(len(FLIPS[face]) * count_poses(inclinations_deg, step_deg, paths), FEWER)
        one_face = with_references(list(grid(inclinations_deg, step_deg, paths)), reference_every)
        poses = [replace(pose, flip=flip) for flip in FLIPS[face] for pose in one_face]
    if poses[0].flip:
        check_level(rig)
    else:
        prepare(rig)
    for pose in rig.missing(poses):
        rig.hold(pose, dwell_s, settle_s)


def grid(inclinations_deg: Sequence[float], step_deg: float, paths: Paths = "grid") -> Iterator[Pose]:
    """The poses of a sweep in order. Raises SettingError unless `step_deg` divides half a turn, or for too many."""
    require_possible(count_poses(inclinations_deg, step_deg, paths), FEWER)
    if abs(HALF_TURN_DEG / step_deg - round(HALF_TURN_DEG / step_deg)) > 1e-9:
        raise SettingError(NOT_A_STEP.format(step_deg))
    for alpha, from_deg, to_deg, path in turns(inclinations_deg, paths):
        yield from turn(alpha, from_deg, to_deg, step_deg, path)


def turns(inclinations_deg: Sequence[float], paths: Paths = "grid") -> list[tuple[float, float, float, str]]:
    """Alpha, first and last beta, and path of each turn of a sweep, in order. Raises SettingError."""
    if not inclinations_deg:
        raise SettingError("sweep: inclinations_deg is empty; give at least one angle, such as 90")
    for alpha in inclinations_deg:
        if abs(alpha) > HALF_TURN_DEG:
            raise SettingError(f"sweep: inclinations_deg has {alpha:g}; give angles from -180 to 180, such as 90")
    signed = [(alpha, -alpha) if paths == "ang" else (alpha,) for alpha in inclinations_deg]
    ordered = []
    for alpha in dict.fromkeys(float(alpha) for pair in signed for alpha in pair):  # -0 is 0
        ordered += [(alpha, 0.0, 360.0, "A+ to B-"), (alpha, 360.0, 0.0, "B+ to A-")]
        if paths == "ang" and alpha == 90:
            ordered += [(alpha, 0.0, 180.0, "A+ to A-"), (alpha, 180.0, 0.0, "A+ to A-")]
            ordered += [(alpha, 0.0, -180.0, "B+ to B-"), (alpha, -180.0, 0.0, "B+ to B-")]
    return ordered


def count_poses(inclinations_deg: Sequence[float], step_deg: float, paths: Paths = "grid") -> float:
    """The number of poses of a grid, without making them. Raises SettingError."""
    if not 0 < step_deg <= HALF_TURN_DEG:
        raise SettingError(NOT_A_STEP.format(step_deg))
    ends = ((from_deg, to_deg) for _, from_deg, to_deg, _ in turns(inclinations_deg, paths))
    return sum(abs(to_deg - from_deg) / step_deg + 1 for from_deg, to_deg in ends)


def with_references(poses: Sequence[Pose], every: int) -> list[Pose]:
    """`poses` with a reference pose at the beginning, after every `every` poses, and at the end."""
    if not every:
        return list(poses)
    parts = [[REFERENCE, *poses[k : k + every]] for k in range(0, len(poses), every)]
    return [pose for part in parts for pose in part] + [REFERENCE]


def turn(alpha_deg: float, from_deg: float, to_deg: float, step_deg: float, path: str) -> Iterator[Pose]:
    """Poses at one inclination from one angle of beta to another, with both ends."""
    direction = 1 if to_deg > from_deg else -1
    for k in range(round(abs(to_deg - from_deg) / step_deg) + 1):
        yield Pose(alpha_deg, from_deg + direction * k * step_deg, direction, path)
