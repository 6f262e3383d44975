"""rate-turn: turn a gyroscope at constant rates, and hold it at rest, on each edge.

Excites   gyroscope: scale factor, bias, misalignment, sensitivity to specific force; nonlinearity over the rates.
Blind to  bandwidth; sensitivity to vibration. The earth's rotation is subtracted if latitude and heading are known.
Source    IEEE Std 1431 and 647, rate table tests; Ferraris, Grimaldi and Parvis (1995): six faces and a turn of each.

The mean over a full turn removes signals with the period of the turn: the horizontal part of the earth's rotation, the
errors of the gear. At rest the sensor is measured at two opposite headings. Alpha = 180 deg turns the sensor over, so
three mounts give six faces.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from procedures.errors import SettingError
from procedures.level_check import prepare
from procedures.questions import EDGES
from procedures.session import Pose, Session

KIND = "rates"
OUTPUTS = ("gx", "gy", "gz")
SIDES_DEG = (0.0, 180.0)  # alpha: the axis points up, then down
HEADINGS_DEG = (0.0, 180.0)  # beta


def rate_turn(
    rig: Session,
    *,
    rates_deg_s: tuple[float, ...] = (20.0, 40.0, 80.0),
    turn_deg: float = 360.0,
    mounts: int = 3,
    rest_s: float = 10.0,
    settle_s: float = 0.5,
) -> None:
    """Turn beta at each rate both ways, with the axis up and down.

    rates_deg_s  The rates.
    turn_deg     The angle of each turn. Give less than 360 if the limits of the stage do not allow a full turn. The
                 limits must leave room for acceleration and braking.
    mounts       The number of edges of the sensor that are upright, one after another. One mount (z up) gives turns
                 about z only.
    rest_s       How long the table rests at each of two headings before the turns, which gives the bias.
    """
    if not rates_deg_s or min(rates_deg_s) <= 0 or min(turn_deg, rest_s) <= 0 or settle_s < 0:
        raise SettingError("rate-turn: rates_deg_s, turn_deg and rest_s must be above 0, settle_s must be 0 or more")
    if mounts not in (1, 2, 3):
        raise SettingError(f"rate-turn: mounts is {mounts}; give 1, 2 or 3")
    rig = replace(rig, adc=rig.adc.only(*OUTPUTS))
    prepare(rig, "Is the gyroscope mounted face up on the table? Can its cable turn freely?")
    rates = [rig.beta.rate_deg_s(rate) for rate in rates_deg_s]
    for pose in rig.missing(pose for up in EDGES[:mounts] for pose in turns(up, rates, turn_deg)):
        if pose.rate_deg_s:
            rig.turn(pose, turn_deg)
        else:
            rig.hold(pose, rest_s, settle_s)


def turns(up: str, rates_deg_s: list[float], turn_deg: float) -> Iterator[Pose]:
    """Rests at two headings, then turns in both directions at every rate; the axis `up` upward, then downward."""
    for alpha_deg in SIDES_DEG:
        for beta_deg in HEADINGS_DEG:
            yield Pose(alpha_deg, beta_deg, 0, f"{up} at rest", up=up)
        for rate in rates_deg_s:
            for direction in (1, -1):
                first_deg, rate_deg_s = -direction * turn_deg / 2, direction * rate
                yield Pose(alpha_deg, first_deg, direction, f"{up} turning", up=up, rate_deg_s=rate_deg_s)
