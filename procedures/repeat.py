"""repeat: repeat the same tumble: without a change, after a power cycle, after a remount.

Excites   repeatability of bias and scale factor from one operation to the next.
Blind to  constant errors; effects of angles between the four positions.
Source    Ang VI, inconsistency between operations; IEEE 1293, repeatability.
"""

from __future__ import annotations

from drivers.errors import LimitError
from procedures.errors import SettingError
from procedures.level_check import prepare
from procedures.questions import PowerCycle, Remount
from procedures.session import Session
from procedures.tumbles import is_first, tumble

AS_IS, POWER, MOUNT = "as-is", "power", "mount"


def repeat(
    rig: Session,
    *,
    times: int = 5,
    power: bool = True,
    mount: bool = True,
    off_s: float = 10.0,
    warm_s: float = 60.0,
    dwell_s: float = 5.0,
    settle_s: float = 0.5,
) -> None:
    """Tumble the sensor several times without a change, after power cycles, and after remounts.

    times   The number of tumbles of each sort.
    power   Whether there are power cycles. The bench's power line switches the power, or a person.
    mount   Whether a person mounts the sensor again before tumbles.
    off_s   The time without power in a power cycle.
    warm_s  The time with power before the next tumble.
    """
    if times < 2 or min(off_s, warm_s, settle_s) < 0 or dwell_s <= 0:
        raise SettingError(
            "repeat: times must be 2 or more, dwell_s must be above 0, off_s, warm_s and settle_s must be 0 or more"
        )
    prepare(rig)
    kinds = [AS_IS, *[POWER] * power, *[MOUNT] * mount]
    paths = (f"{kind} {k}" for kind in kinds for k in range(1, times + 1))
    for pose in rig.missing(pose for path in paths for pose in tumble(path)):
        kind, _, number = pose.path.partition(" ")
        if is_first(pose) and kind == POWER:
            _power_cycle(rig, number, off_s, warm_s)
        if is_first(pose) and kind == MOUNT:
            _remount(rig, number)
        rig.hold(pose, dwell_s, settle_s)


def _power_cycle(rig: Session, number: str, off_s: float, warm_s: float) -> None:
    try:
        rig.adc.power(False)
    except LimitError:  # the bench has no power line
        text = f"Switch the sensor off for {off_s:g} s, then on. Is it done?"
        rig.request(PowerCycle(f"power-cycle-{number}", text, off_s=off_s))
    else:
        rig.wait(off_s)
        rig.adc.power(True)
    rig.wait(warm_s)


def _remount(rig: Session, number: str) -> None:
    """Remount the sensor at alpha = 0, where the table is horizontal."""
    rig.alpha.move_to(0.0)
    text = "Take the sensor off the table and mount it again in the same way, face up. Is it done?"
    rig.request(Remount(f"remount-{number}", text, drawing="face-up"))
