"""soak: hold the sensor still for hours from power-on, with a tumble at intervals.

Excites   warm-up and other slow drift of bias and scale factor; noise at all time scales up to hours.
Blind to  drift that ends before the second tumble; a drift of the room's temperature, which looks like the sensor's.
Source    Ang III.B, Fig. 10: twelve hours at constant ambient; IEEE 1293, four-point tumble.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from itertools import groupby, repeat

from drivers.errors import LimitError
from procedures.bounds import MOST_POSES, count_parts
from procedures.errors import SettingError
from procedures.level_check import prepare
from procedures.session import Pose, Reading, Session
from procedures.tumbles import is_first, tumble

REVERSAL, HOLD = "reversal", "hold"  # first words of the paths; a number follows
DOUBLINGS = 4  # of the interval, from the first to the longest
POWER_ON = "power-on"  # name of the reading: the clock's time when the sensor was switched on


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
    """Hold the sensor level for hours, with a tumble before, after, and at intervals.

    The first intervals are shorter and double each time, because drift is fastest at the beginning.

    duration_s    How long the sensor is held. The tumbles take extra time.
    interval_s    The longest time between two tumbles.
    off_s         The time without power before the soak, so that it begins cold; 0: no power cycle. Only on a bench
                  with a power line.
    oven_c        The temperature of the oven; 0: no oven.
    until_steady  Whether the soak ends when bias and scale factor are steady.
    """
    if min(duration_s, dwell_s) <= 0 or not 0 < block_s <= interval_s or min(settle_s, off_s) < 0:
        raise SettingError(
            "soak: duration_s, block_s and dwell_s must be above 0, settle_s and off_s must be 0 or more, "
            "interval_s must be at least block_s"
        )
    prepare(rig)
    for path, group in groupby(rig.missing(schedule(duration_s, interval_s, block_s)), key=lambda pose: pose.path):
        poses = list(group)
        if until_steady and path.startswith(HOLD) and rig.steady(rig.measured(), oven_c):
            break
        if off_s and path == f"{REVERSAL} 0" and is_first(poses[0]) and not rig.measured():
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
    """The poses: a tumble, a hold of many blocks, a tumble ... and a last tumble.

    The sensor is level in the hold, so both axes feel 0 g: the hold shows the drift of the bias between tumbles.
    """
    remaining, number = count_parts(duration_s, block_s), 0
    longest = max(1, round(min(interval_s / block_s, MOST_POSES << DOUBLINGS)))
    while remaining > 0:
        blocks = min(remaining, longest, max(1, longest >> max(0, DOUBLINGS - number)))
        yield from tumble(f"{REVERSAL} {number}")
        yield from repeat(Pose(0.0, 0.0, 0, f"{HOLD} {number}"), blocks)
        remaining, number = remaining - blocks, number + 1
    yield from tumble(f"{REVERSAL} {number}")


def _cold_start(rig: Session, off_s: float) -> None:
    """Switch the sensor off for `off_s`, then on. Without a power line on the bench nothing happens."""
    with suppress(LimitError):
        rig.adc.power(False)
        rig.host.doing(f"cooling for {off_s:g} s without power")
        rig.wait(off_s)
        rig.adc.power(True)
        rig.keep_readings(Reading(POWER_ON, rig.clock.now(), "s"))


def _keep_on(rig: Session, off_s: float, oven_c: float) -> None:
    """Switch sensor and oven on. This is repeated before every tumble and hold: a power cut may switch them off."""
    if off_s:
        with suppress(LimitError):
            rig.adc.power(True)
    if oven_c:
        rig.oven.set_temperature(oven_c)
        rig.oven.run(True)
