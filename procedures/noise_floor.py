"""noise-floor: record the still sensor: its noise, and the smallest inclination.

Excites   noise of sensor, supply and converter.
Blind to  all effects of the pose.
Source    Ang V: peak-to-peak noise is 4 x rms, 3.1 mV, equal to an inclination of 0.2 deg.
"""

from __future__ import annotations

from procedures.bounds import count_parts, require_bounded
from procedures.errors import SettingError
from procedures.level_check import check_level
from procedures.session import Pose, Session

KIND = "still"
STILL = "still"  # path of the record
SCALE_POSES = tuple(Pose(90.0, beta, 0, "scale") for beta in (0.0, 90.0, 180.0, 270.0))  # +-1 g on x and on y


def noise_floor(
    rig: Session, *, duration_s: float = 60.0, block_s: float = 10.0, dwell_s: float = 2.0, settle_s: float = 1.0
) -> None:
    """Measure the scale factor at +-1 g on each axis, then record the sensor with its axes horizontal.

    duration_s  How long the still sensor is recorded.
    """
    if min(duration_s, block_s, dwell_s) <= 0:
        raise SettingError("noise-floor: duration_s, block_s and dwell_s must be above 0")
    check_level(rig)
    for pose in rig.missing(SCALE_POSES):
        rig.hold(pose, dwell_s, settle_s)
    still = require_bounded(Pose(0.0, 0.0, 0, f"{STILL} {k}") for k in range(count_parts(duration_s, block_s)))
    if missing := list(rig.missing(still)):
        rig.move_to(missing[0])
        rig.wait(settle_s)
        rig.keep_stretch(missing, block_s)
