"""check-standard: one short tumble of a sensor that stays with the rig, for the control chart.

Excites   changes of the rig from day to day: reference, converter, supply, stages, the check standard itself.
Blind to  constant errors; which part of the rig has changed.
Source    NIST/SEMATECH e-Handbook 2.2, check standards; IEEE 1293, four-point tumble. `rig control` draws the chart.
"""

from __future__ import annotations

from procedures.errors import SettingError
from procedures.level_check import prepare
from procedures.session import Session
from procedures.tumbles import tumble


def check_standard(rig: Session, *, dwell_s: float = 5.0, settle_s: float = 0.5) -> None:
    """Hold the check standard at four angles of beta at alpha = 90 deg, with beta rising and falling: eight poses.

    The poses are always the same, so the points of the control chart can be compared. The bench file gives the serial
    number of the check standard.
    """
    if dwell_s <= 0 or settle_s < 0:
        raise SettingError(f"check-standard: dwell_s is {dwell_s:g} and settle_s is {settle_s:g}; give times above 0")
    prepare(rig, "Is the check standard mounted face up on the table? Can its cable move freely?")
    for pose in rig.missing(tumble("tumble 1")):
        rig.hold(pose, dwell_s, settle_s)
