"""check-standard: one short tumble of a sensor that stays with the rig, for its control chart.

Excites   whatever changes in the rig from day to day: reference, converter, supply, stages, the standard itself.
Blind to  what stays the same; which part of the rig has changed.
Source    NIST/SEMATECH e-Handbook 2.2, check standards; IEEE 1293, four-point tumble. `rig control` draws the chart.
"""

from __future__ import annotations

from procedures.errors import SettingError
from procedures.level_check import levelled
from procedures.session import Session
from procedures.tumbles import tumble


def check_standard(rig: Session, *, dwell_s: float = 5.0, settle_s: float = 0.5) -> None:
    """Hold the check standard at the four positions of beta at alpha = 90 deg, up and down: eight poses.

    The same before every run, so that the points of a chart are alike. Its serial number is that of the bench file.
    """
    if dwell_s <= 0 or settle_s < 0:
        raise SettingError(f"check-standard: dwell_s is {dwell_s:g}, settle_s is {settle_s:g}: give times above 0")
    rig.confirm("mounting", "Is the check standard mounted face up on the table, its cable free?", drawing="face-up")
    levelled(rig)
    for pose in rig.missing(tumble("check 1")):
        rig.hold(pose, dwell_s, settle_s)
