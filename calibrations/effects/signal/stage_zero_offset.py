from dataclasses import replace

import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.geometry.orientation import Pose
from calibrations.table import Table


class StageZeroOffset(Effect):
    """stage-zero-offset: the zero marks of the stages do not agree with the vertical and the edge of the sensor.

        alpha <- alpha + alpha0,   beta <- beta + beta0   both in deg

    Symptom   the residual has the shape of the derivative of the output with respect to an angle, on all axes.
    Excited by  full turns of beta at inclinations below and above alpha = 90 deg.
    Confused with  axis-misalignment about z, which equals an offset of beta; base-tilt, whose component y equals an
              offset of alpha. To separate the sensor from the stage, mount the sensor face down.
    Source    Ang V (inclinations checked with a digital level to 0.1 deg); NISTIR 7925.
    """

    kinds = ("poses", "motion")
    exact = True

    alpha = Parameter("deg", typical=1.0, per_axis=False, doc="added to the angle alpha")
    beta = Parameter("deg", typical=1.0, per_axis=False, doc="added to the angle beta")

    def pose(self, pose: Pose, table: Table, p: Values) -> Pose:
        return replace(pose, alpha=pose.alpha + np.radians(p.alpha), beta=pose.beta + np.radians(p.beta))
