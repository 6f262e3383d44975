"""soak: hours of warm-up held still; bias and scale factor from reversals.

Excites   warm-up and other slow drift of bias and scale factor; noise of every time scale up to hours.
Blind to  drift that is over before the second reversal; the room's temperature, which drifts like the sensor.
Source    Ang III.B, Fig. 10: twelve hours at constant ambient; IEEE 1293, four-point tumble.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from itertools import groupby

from drivers.errors import LimitError
from procedures.errors import SettingError
from procedures.level_check import levelled
from procedures.session import Pose, Reading, Session
from procedures.tumbles import is_first, tumble

REVERSAL, HOLD = "reversal", "hold"  # each with its number is a path
DOUBLINGS = 4  # of the interval from the first to the longest
POWER_ON = "power-on"  # the clock's reading when the sensor was switched on


def soak(
    rig: Session,
    *,
    duration_s: float = 43200.0,
    interval_s: float = 900.0,
    block_s: float = 10.0,
    dwell_s: float = 5.0,
    settle_s: float = 0.5,
    off_s: float = 3600.0,
    oven_c: float = 0.0,
    until_steady: bool = False,
) -> None:
    """Hold the sensor level for `duration_s`, with a tumble before, after, and every `interval_s` in between.

    The hold is kept without gaps, `block_s` at a time; the tumbles' time comes on top. The first intervals are shorter
    and double, as drift is quickest there. It begins cold, `off_s` without
    power and then on, where the bench has a line that switches it (0: as it is). `oven_c` keeps it in the oven from
    then on (0: none). `until_steady` ends it as soon as bias and scale factor have come to rest.
    """
    if min(duration_s, dwell_s) <= 0 or not 0 < block_s <= interval_s or min(settle_s, off_s) < 0:
        raise SettingError(
            "soak: duration_s, block_s and dwell_s must be above 0, settle_s and off_s not below, "
            "and interval_s at least block_s"
        )
    rig.confirm("mounting", "Is the sensor mounted face up on the table, its cable free to turn?", drawing="face-up")
    levelled(rig)
    for path, group in groupby(rig.missing(schedule(duration_s, interval_s, block_s)), key=lambda pose: pose.path):
        poses = list(group)
        if until_steady and path.startswith(HOLD) and rig.steady(rig.measured(), oven_c):
            break
        if off_s and path == f"{REVERSAL} 0" and is_first(poses[0]):
            _cold_start(rig, off_s)
        _keep_on(rig, off_s, oven_c)
        if path.startswith(HOLD):
            rig.move_to(poses[0])
            rig.wait(settle_s)
            rig.keep_stretch(poses, block_s)
        else:
            for pose in poses:
                rig.hold(pose, dwell_s, settle_s)
    if oven_c:
        rig.oven.run(False)


def schedule(duration_s: float, interval_s: float, block_s: float) -> Iterator[Pose]:
    """A tumble, a hold of many blocks, a tumble ... and a last tumble: blocks of one hold are alike.

    Level, both axes feel 0 g, so that the hold shows the drift of their bias between tumbles.
    """
    left, number = max(1, round(duration_s / block_s)), 0
    longest = max(1, round(interval_s / block_s))
    while left > 0:
        blocks = min(left, longest, max(1, longest >> max(0, DOUBLINGS - number)))
        yield from tumble(f"{REVERSAL} {number}")
        yield from [Pose(0.0, 0.0, 0, f"{HOLD} {number}")] * blocks
        left, number = left - blocks, number + 1
    yield from tumble(f"{REVERSAL} {number}")


def _cold_start(rig: Session, off_s: float) -> None:
    """Off for `off_s`, then on. Where no line of the bench does it, the sensor stays as it is."""
    with suppress(LimitError):
        rig.adc.power(False)
        rig.host.doing(f"cooling for {off_s:g} s without power")
        rig.wait(off_s)
        rig.adc.power(True)
        rig.keep_readings(Reading(POWER_ON, rig.clock.now(), "s"))


def _keep_on(rig: Session, off_s: float, oven_c: float) -> None:
    """Sensor and oven on, told before every tumble and hold: a power cut may have switched them off."""
    if off_s:
        with suppress(LimitError):
            rig.adc.power(True)
    if oven_c:
        rig.oven.set_temperature(oven_c)
        rig.oven.run(True)
