"""stage-eccentricity: the angle scale of the stage is off centre, an error of one wave in a turn.

    beta <- beta + s sin(beta) + c cos(beta)          s, c in deg

Symptom   the residual has two waves in a turn of beta, beside a constant shift; on all axes alike.
Excited by  full turns of beta.
Confused with  cross-axis-scale and the squares of single axes, which have a size of their own on each axis.
Source    NISTIR 7925; graduation errors of rotary tables.
"""

from dataclasses import replace

import numpy as np

from calibrations.chain import Pose
from calibrations.effect import Parameter, Values
from calibrations.table import Table

KINDS = ("poses", "motion")
PARAMETERS = (
    Parameter("sine", "deg", typical=0.2, per_axis=False, doc="error of beta at beta = 90 deg"),
    Parameter("cosine", "deg", typical=0.2, per_axis=False, doc="error of beta at beta = 0 deg"),
)


def pose(pose: Pose, table: Table, p: Values) -> Pose:
    wave = np.radians(p["sine"]) * np.sin(pose.beta) + np.radians(p["cosine"]) * np.cos(pose.beta)
    return replace(pose, beta=pose.beta + wave)
