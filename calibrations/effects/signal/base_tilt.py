from dataclasses import replace

import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.geometry.orientation import Pose, rotation
from calibrations.table import Table


class BaseTilt(Effect):
    """base-tilt: the base of the stages is not level.

        up <- R(theta) up                                 theta: rotation vector of the base in deg, components x, y

    Symptom   the residual follows the tilt of the alpha axis out of the horizontal, and an offset of alpha.
    Excited by  full turns of beta at inclinations below and above alpha = 90 deg.
    Confused with  stage-zero-offset: the component y equals an offset of alpha. To separate them, turn the whole rig.
    Source    Ang V (level check before every experiment); IEEE Std 1293.
    """

    kinds = ("poses", "motion")
    exact = True

    x = Parameter("deg", typical=1.0, per_axis=False, doc="tilt of the base about its x axis")
    y = Parameter("deg", typical=1.0, per_axis=False, doc="tilt of the base about its y axis, that of alpha")

    def pose(self, pose: Pose, table: Table, p: Values) -> Pose:
        return replace(pose, up=rotation(np.radians(np.array([p.x, p.y, 0.0]))) @ pose.up)
