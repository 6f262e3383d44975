import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.geometry.orientation import rotation
from calibrations.table import Array, Table


class AxisMisalignment(Effect):
    """axis-misalignment: the sensing axes are rotated together against the reference edges.

        a <- R(theta)^T a                                 theta: rotation vector in deg, components x, y, z

    Symptom   the residual follows the specific force along the other axes; a rotation about z has opposite signs on x
              and y.
    Excited by  full turns of beta; the components x and y need inclinations different from alpha = 90 deg.
    Confused with  stage-zero-offset: a rotation about z equals an offset of beta. To separate them, mount the sensor
              face down.
    Source    Ang (18)-(21); Book 17.3.9.
    """

    kinds = ("poses", "motion")
    exact = True

    x = Parameter("deg", typical=2.0, per_axis=False, doc="turn about the sensor's x axis")
    y = Parameter("deg", typical=2.0, per_axis=False, doc="turn about the sensor's y axis")
    z = Parameter("deg", typical=2.0, per_axis=False, doc="turn about the sensor's z axis")

    def force(self, a: Array, table: Table, p: Values) -> Array:
        return a @ rotation(np.radians([p.x, p.y, p.z]))
