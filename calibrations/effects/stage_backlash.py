"""stage-backlash: the table lags behind the motor by the play of its gear, on the side from which it comes.

    beta <- beta - d s                                d in deg: half the play; s = +-1: side of the last move of beta

Symptom   clockwise and anticlockwise turns differ by the output's derivative with respect to beta, on all axes alike.
Excited by  every angle approached from both sides.
Confused with  hysteresis of the sensor, which has a size of its own on each axis.
Source    Ang V (stage resolution 5 arcmin); IEEE Std 1293, test equipment errors.
"""

from dataclasses import replace

import numpy as np

from calibrations.chain import Pose
from calibrations.effect import Parameter, Values
from calibrations.table import Table
from calibrations.visits import last_turn

KINDS = ("poses",)
NEEDS = ("direction",)
PARAMETERS = (Parameter("half_play", "deg", typical=0.2, per_axis=False, doc="lag of beta behind its motor"),)


def pose(pose: Pose, table: Table, p: Values) -> Pose:
    return replace(pose, beta=pose.beta - np.radians(p["half_play"]) * last_turn(table))
