"""gyro-g-sensitivity: the output of a gyroscope follows the specific force.

    V_i += x_i a_x + y_i a_y + z_i a_z                x, y, z in {out}/g, one per axis of the gyroscope; a in g

Symptom   the output at rest changes with the face that the sensor stands on.
Excited by  several orientations, at rest or turning, and an accelerometer beside the gyroscope.
Confused with  gyro-bias, where the sensor was held one way only; gyro-misalignment, where it was never at rest.
Source    Ferraris, Grimaldi and Parvis, Sensors and Materials 7 (1995); IEEE Std 528, drift rate by acceleration.
"""

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.table import AXES, Array, Table
from calibrations.turning import specific_force_g

KINDS = ("rates",)
LEFT_OUT = "it follows the specific force by an accelerometer with a calibration of its own"
NEEDS = ("ax", "ay", "az")
PARAMETERS = tuple(
    Parameter(axis, "{out}/g", typical=0.1, doc=f"output per g of specific force along {axis}") for axis in AXES
)


def transduction(a: Array, table: Table, p: Values) -> Array:
    return np.asarray(specific_force_g(table) @ np.array([p[axis] for axis in AXES]))
