"""stage-zero-offset: the stages' zeros are not where the vertical and the sensor's edge are.

    alpha <- alpha + alpha0,   beta <- beta + beta0   both in deg

Symptom   the residual has the shape of the output's derivative with respect to an angle, on all axes alike.
Excited by  full turns of beta at inclinations on both sides of alpha = 90 deg.
Confused with  axis-misalignment about z, which equals a beta offset; base-tilt, of which one component equals an alpha
          offset. A face-down mount tells the sensor's error from the stage's.
Source    Ang V (inclinations checked with a digital level to 0.1 deg); NISTIR 7925.
"""

from dataclasses import replace

import numpy as np

from calibrations.chain import Pose
from calibrations.effect import Parameter, Values
from calibrations.table import Table

KINDS = ("poses", "motion")
EXACT = True
PARAMETERS = (
    Parameter("alpha", "deg", typical=1.0, per_axis=False, doc="added to the angle alpha"),
    Parameter("beta", "deg", typical=1.0, per_axis=False, doc="added to the angle beta"),
)


def pose(pose: Pose, table: Table, p: Values) -> Pose:
    return replace(pose, alpha=pose.alpha + np.radians(p["alpha"]), beta=pose.beta + np.radians(p["beta"]))
