"""rate-turn: beta at constant rates both ways, and at rest, a gyroscope on each edge.

Excites   gyroscope: scale factor, bias, misalignment, sensitivity to specific force; nonlinearity over the rates.
Blind to  bandwidth, and sensitivity to vibration; the earth's rotation is there, and is taken off where it is known.
Source    IEEE Std 1431 and 647, rate table tests; Ferraris, Grimaldi and Parvis (1995): six faces and a turn of each.

A mean over a whole turn is free of what goes round once in it: the horizontal part of the earth's rotation, the gear's
errors. At rest both headings are measured. Alpha at 180 deg turns the sensor over, so that three mounts are six faces.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from procedures.errors import SettingError
from procedures.level_check import levelled
from procedures.questions import EDGES
from procedures.session import Pose, Session

KIND = "rates"
OUTPUTS = ("gx", "gy", "gz")
SIDES_DEG = (0.0, 180.0)  # of alpha: the edge up, and down
HEADINGS_DEG = (0.0, 180.0)  # of beta


def rate_turn(
    rig: Session,
    *,
    rates_deg_s: tuple[float, ...] = (20.0, 40.0, 80.0),
    turn_deg: float = 360.0,
    mounts: int = 3,
    rest_s: float = 10.0,
    settle_s: float = 0.5,
) -> None:
    """Turn beta by `turn_deg` at each rate, both ways, and rest, with the edge up and down; on each of `mounts` edges.

    On one mount (z up) only the axis z is turned about. `turn_deg` of less than a whole turn is for stages whose limits
    allow none; the rates must leave room for run-up and braking.
    """
    if not rates_deg_s or min(rates_deg_s) <= 0 or min(turn_deg, rest_s) <= 0 or settle_s < 0:
        raise SettingError("rate-turn: rates_deg_s, turn_deg and rest_s must be above 0, settle_s not below")
    if mounts not in (1, 2, 3):
        raise SettingError(f"rate-turn: mounts is {mounts}; give 1, 2 or 3")
    rig = replace(rig, adc=rig.adc.only(*OUTPUTS))
    rig.confirm("mounting", "Is the gyroscope mounted face up on the table, its cable free to turn?", drawing="face-up")
    levelled(rig)
    rates = [rig.beta.rate_deg_s(rate) for rate in rates_deg_s]
    for pose in rig.missing(pose for up in EDGES[:mounts] for pose in turns(up, rates, turn_deg)):
        if pose.rate_deg_s:
            rig.turn(pose, turn_deg)
        else:
            rig.hold(pose, rest_s, settle_s)


def turns(up: str, rates_deg_s: list[float], turn_deg: float) -> Iterator[Pose]:
    """At rest at two headings, turned both ways at every rate; the edge `up` upward, then downward."""
    for alpha_deg in SIDES_DEG:
        for beta_deg in HEADINGS_DEG:
            yield Pose(alpha_deg, beta_deg, 0, f"{up} at rest", up=up)
        for rate in rates_deg_s:
            for way in (1, -1):
                yield Pose(alpha_deg, -way * turn_deg / 2, way, f"{up} turning", up=up, rate_deg_s=way * rate)
