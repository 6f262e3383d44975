from dataclasses import replace

import numpy as np

from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.geometry.orientation import Pose
from calibrations.geometry.stage_path import APPROACH_DOC, STATED_APPROACH, last_turn, with_approach
from calibrations.table import Table


class StageBacklash(Effect):
    """stage-backlash: the table lags behind the motor by the play of its gear, on the side from which it comes.

        beta <- beta - d s          d in deg: half the play; s = +-1: direction of the last move of beta

    Symptom   clockwise and anticlockwise turns differ by the derivative of the output with respect to beta, on all
              axes.
    Excited by  every angle, approached from both sides.
    Confused with  hysteresis of the sensor, which has a different size on each axis.
    Source    Ang V (stage resolution 5 arcmin); IEEE Std 1293, test equipment errors.
    """

    kinds = ("poses",)
    needs = ("direction",)

    half_play = Parameter("deg", typical=0.2, per_axis=False, doc="lag of beta behind its motor")
    approach_deg = Constant(lambda _: STATED_APPROACH, doc=APPROACH_DOC)  # a search may find it

    def pose(self, pose: Pose, table: Table, p: Values) -> Pose:
        side = last_turn(with_approach(table, float(p.approach_deg)))
        return replace(pose, beta=pose.beta - np.radians(p.half_play) * side)
