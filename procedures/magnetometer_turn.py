"""magnetometer-turn: full turns of a level magnetometer, with each of its axes vertical in turn.

Excites   hard iron and soft iron that turn with the sensor; its offsets, scale factors and angles between its axes.
Blind to  iron and magnets fixed to the rig, which are part of the field; the fields of the motors at other angles.
Source    Book 17.5: a full horizontal turn; Renaudin, Afzal and Lachapelle (2010): the ellipsoid of all directions.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from procedures.bounds import count_parts
from procedures.errors import SettingError
from procedures.level_check import prepare
from procedures.questions import EDGES
from procedures.session import Pose, Session

KIND = "positions"
OUTPUTS = ("mx", "my", "mz")
SIDES = ("up", "down")
STEPS = 8  # minimum of poses in a turn: an ellipse has five parameters


def magnetometer_turn(
    rig: Session,
    *,
    step_deg: float = 15.0,
    mounts: int = 3,
    over: bool = True,
    dwell_s: float = 1.0,
    settle_s: float = 0.5,
) -> None:
    """Hold the sensor at the steps of full turns of beta at alpha = 0.

    step_deg  The step of beta.
    mounts    The number of edges of the sensor that are upright, one after another. One mount without over gives a
              horizontal turn only: two of the three components of hard iron. Three mounts cover all directions: with
              over everywhere on earth, without over where the dip of the field is 50 deg at most.
    over      Whether alpha = 180 deg turns the sensor over for a second turn of beta. Choose no if iron of the rig
              moves with alpha.
    """
    if not 0 < step_deg <= 360 / STEPS or dwell_s <= 0 or settle_s < 0:
        most = f"step_deg must be above 0 and at most {360 / STEPS:g}"
        raise SettingError(f"magnetometer-turn: {most}, dwell_s must be above 0, settle_s must be 0 or more")
    if mounts not in (1, 2, 3):
        raise SettingError(f"magnetometer-turn: mounts is {mounts}; give 1, 2 or 3")
    rig = replace(rig, adc=rig.adc.only(*OUTPUTS))
    text = "Is the magnetometer mounted face up? Are all magnetic things that are not parts of the rig 2 m away?"
    prepare(rig, text)
    sides = SIDES[: 1 + over]
    for pose in rig.missing(pose for up in EDGES[:mounts] for side in sides for pose in full_turn(up, side, step_deg)):
        rig.hold(pose, dwell_s, settle_s)


def full_turn(up: str, side: str, step_deg: float) -> Iterator[Pose]:
    """A full turn with the edge `up` upward or downward: beta rises on the side "up" and falls on the side "down"."""
    alpha_deg, direction = (0.0, 1) if side == "up" else (180.0, -1)
    count = count_parts(360, step_deg)
    for k in range(count)[::direction]:
        yield Pose(alpha_deg, k * step_deg, direction, f"{up} {side}", up=up)
