import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.geometry.rate_table import specific_force_g
from calibrations.table import AXES, Array, Table


class GyroGSensitivity(Effect):
    """gyro-g-sensitivity: the output of a gyroscope follows the specific force.

        V_i += x_i a_x + y_i a_y + z_i a_z                x, y, z in {out}/g, one per axis of the gyroscope; a in g

    Symptom   the output at rest changes with the side on which the sensor lies.
    Excited by  several orientations, at rest or turning, and an accelerometer mounted with the gyroscope.
    Confused with  gyro-bias, if the sensor had one orientation only; gyro-misalignment, if it was never at rest.
    Source    Ferraris, Grimaldi and Parvis, Sensors and Materials 7 (1995); IEEE Std 528, drift rate by acceleration.
    """

    kinds = ("rates", "turns")
    left_out = "it needs the specific force from an accelerometer, which has its own calibration"
    needs = ("ax", "ay", "az")

    x = Parameter("{out}/g", typical=0.1, doc="output per g of specific force along x")
    y = Parameter("{out}/g", typical=0.1, doc="output per g of specific force along y")
    z = Parameter("{out}/g", typical=0.1, doc="output per g of specific force along z")

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        return np.asarray(specific_force_g(table) @ np.array([p[axis] for axis in AXES]))
