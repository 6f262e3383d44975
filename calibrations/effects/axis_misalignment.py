"""axis-misalignment: the sensing axes are turned as a whole against the reference edges.

    a <- R(theta)^T a                                 theta: rotation vector in deg, components x, y, z

Symptom   the residual follows the specific force along the other axes; a turn about z: opposite signs on x and y.
Excited by  full turns of beta; the components x and y need inclinations away from alpha = 90 deg.
Confused with  stage-zero-offset: a turn about z equals a beta offset. A face-down mount tells them apart.
Source    Ang (18)-(21); Book 17.3.9.
"""

import numpy as np

from calibrations.axes import rotation
from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

KINDS = ("poses", "motion")
EXACT = True
PARAMETERS = (
    Parameter("x", "deg", typical=2.0, per_axis=False, doc="turn about the sensor's x axis"),
    Parameter("y", "deg", typical=2.0, per_axis=False, doc="turn about the sensor's y axis"),
    Parameter("z", "deg", typical=2.0, per_axis=False, doc="turn about the sensor's z axis"),
)


def force(a: Array, table: Table, p: Values) -> Array:
    return a @ rotation(np.radians([p["x"], p["y"], p["z"]]))
