"""magnetometer-turn: level, beta once round, with each edge of a magnetometer upright.

Excites   hard iron and soft iron that turn with the sensor, its offsets, scale factors and angles between its axes.
Blind to  iron and magnets that stand with the rig: they are part of the field; the motors' fields at other angles.
Source    Book 17.5: a full horizontal turn; Renaudin, Afzal and Lachapelle (2010): the ellipsoid of all directions.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from procedures.errors import SettingError
from procedures.level_check import levelled
from procedures.questions import EDGES
from procedures.session import Pose, Session

KIND = "positions"
OUTPUTS = ("mx", "my", "mz")
SIDES = ("up", "down")
STEPS = 8  # a turn, at least: an ellipse has five parameters


def magnetometer_turn(
    rig: Session,
    *,
    step_deg: float = 15.0,
    mounts: int = 3,
    over: bool = True,
    dwell_s: float = 1.0,
    settle_s: float = 0.5,
) -> None:
    """Hold the sensor at every `step_deg` of a full turn of beta at alpha = 0, on each of `mounts` edges.

    With `over` it is turned over and round once more on each, at alpha = 180. One mount (z up) not turned over shows a
    horizontal turn alone: two of three components of hard iron. Three cover the sphere: turned over anywhere on earth,
    else where the field dips by 50 deg at most. Leave `over` out where iron of the rig moves with alpha.
    """
    if not 0 < step_deg <= 360 / STEPS or dwell_s <= 0 or settle_s < 0:
        most = f"step_deg must be above 0 and at most {360 / STEPS:g}"
        raise SettingError(f"magnetometer-turn: {most}, dwell_s above 0, settle_s not below")
    if mounts not in (1, 2, 3):
        raise SettingError(f"magnetometer-turn: mounts is {mounts}; give 1, 2 or 3")
    rig = replace(rig, adc=rig.adc.only(*OUTPUTS))
    text = "Is the magnetometer mounted face up, and all that is magnetic and does not belong to the rig 2 m away?"
    rig.confirm("mounting", text, drawing="face-up")
    levelled(rig)
    sides = SIDES[: 1 + over]
    for pose in rig.missing(pose for up in EDGES[:mounts] for side in sides for pose in full_turn(up, side, step_deg)):
        rig.hold(pose, dwell_s, settle_s)


def full_turn(up: str, side: str, step_deg: float) -> Iterator[Pose]:
    """Once round with the edge `up` upward or downward: forth on one side, back on the other."""
    alpha_deg, way = (0.0, 1) if side == "up" else (180.0, -1)
    count = round(360 / step_deg)
    for k in range(count)[::way]:
        yield Pose(alpha_deg, k * step_deg, way, f"{up} {side}", up=up)
