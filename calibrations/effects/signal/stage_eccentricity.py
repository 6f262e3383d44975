from dataclasses import replace

import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.geometry.orientation import Pose
from calibrations.table import Table


class StageEccentricity(Effect):
    """stage-eccentricity: the angle scale of the stage is off centre, so the angle error has one wave in a turn.

        beta <- beta + s sin(beta) + c cos(beta)          s, c in deg

    Symptom   the residual has two waves in a turn of beta and a constant part, on all axes.
    Excited by  full turns of beta.
    Confused with  cross-axis-scale and the squares of single axes, which have a different size on each axis.
    Source    NISTIR 7925; graduation errors of rotary tables.
    """

    kinds = ("poses", "motion")

    sine = Parameter("deg", typical=0.2, per_axis=False, doc="error of beta at beta = 90 deg")
    cosine = Parameter("deg", typical=0.2, per_axis=False, doc="error of beta at beta = 0 deg")

    def pose(self, pose: Pose, table: Table, p: Values) -> Pose:
        wave = np.radians(p.sine) * np.sin(pose.beta) + np.radians(p.cosine) * np.cos(pose.beta)
        return replace(pose, beta=pose.beta + wave)
