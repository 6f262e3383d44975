"""base-tilt: the base of the stages is not level.

    up <- R(theta) up                                 theta: rotation vector of the base in deg, components x, y

Symptom   the residual follows the tilt of the alpha axis out of the horizontal, and an offset of alpha.
Excited by  full turns of beta at inclinations on both sides of alpha = 90 deg.
Confused with  stage-zero-offset: the component y equals an offset of alpha. Turning the whole rig tells them apart.
Source    Ang V (level check before every experiment); IEEE Std 1293.
"""

from dataclasses import replace

import numpy as np

from calibrations.axes import rotation
from calibrations.chain import Pose
from calibrations.effect import Parameter, Values
from calibrations.table import Table

KINDS = ("poses", "motion")
EXACT = True
PARAMETERS = (
    Parameter("x", "deg", typical=1.0, per_axis=False, doc="tilt of the base about its x axis"),
    Parameter("y", "deg", typical=1.0, per_axis=False, doc="tilt of the base about its y axis, that of alpha"),
)


def pose(pose: Pose, table: Table, p: Values) -> Pose:
    return replace(pose, up=rotation(np.radians(np.array([p["x"], p["y"], 0.0]))) @ pose.up)
