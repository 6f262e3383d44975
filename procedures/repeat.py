"""repeat: the same tumble again and again: as it is, after a power cycle, after a remount.

Excites   what changes from one operation to the next: repeatability of bias and scale factor.
Blind to  what stays the same, and whatever depends on the angle between the four positions.
Source    Ang VI, inconsistency between operations; IEEE 1293, repeatability.
"""

from __future__ import annotations

from drivers.errors import LimitError
from procedures.errors import SettingError
from procedures.level_check import levelled
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
    """Tumble the sensor `times` times as it is, then as often after a power cycle, then after a remount.

    A power cycle is `off_s` without power and `warm_s` with it, by the bench's power line or else by hand.
    """
    if times < 2 or min(off_s, warm_s, settle_s) < 0 or dwell_s <= 0:
        raise SettingError("repeat: times must be 2 or more, off_s, warm_s and settle_s not below 0, dwell_s above")
    rig.confirm("mounting", "Is the sensor mounted face up on the table, its cable free to turn?", drawing="face-up")
    levelled(rig)
    kinds = [AS_IS, *[POWER] * power, *[MOUNT] * mount]
    paths = [f"{kind} {k}" for kind in kinds for k in range(1, times + 1)]
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
    except LimitError:  # no line does it
        text = f"Have you switched the sensor off for {off_s:g} s, and on again?"
        rig.have_done(PowerCycle(f"power-cycle-{number}", text, off_s=off_s))
    else:
        rig.wait(off_s)
        rig.adc.power(True)
    rig.wait(warm_s)


def _remount(rig: Session, number: str) -> None:
    """At alpha = 0, where the sensor lies flat."""
    rig.alpha.move_to(0.0)
    text = "Have you taken the sensor off the table, and mounted it again the same way, face up?"
    rig.have_done(Remount(f"remount-{number}", text, drawing="face-up"))
