import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.table import Array, Table


class AxisNonorthogonality(Effect):
    """axis-nonorthogonality: the angles between the sensing axes are not 90 deg.

        y = (sin xy, cos xy, 0)      z = (sin xz, sin yz, sqrt(1 - sin^2 xz - sin^2 yz))      x = (1, 0, 0)

        the sensing axes as unit vectors; xy, xz, yz in deg: departures from 90 deg, positive where the angle is less

    Symptom   one axis measures part of the specific force along another axis, but not the reverse.
    Excited by  full turns of beta; for positions, orientations spread over the sphere.
    Confused with  axis-misalignment, if only one axis was measured.
    Source    Ang IV; Book (17.3); Tedaldi et al., ICRA 2014 (triad).
    """

    exact = True

    xy = Parameter("deg", typical=2.0, per_axis=False, measured="y", doc="x-y departure from 90 deg")
    xz = Parameter("deg", typical=2.0, per_axis=False, measured="z", doc="x-z departure from 90 deg")
    yz = Parameter("deg", typical=2.0, per_axis=False, measured="z", doc="y-z departure from 90 deg")

    def force(self, a: Array, table: Table, p: Values) -> Array:
        xy, xz, yz = (np.sin(np.radians(p[name])) for name in ("xy", "xz", "yz"))
        axes: Array = np.array(
            [[1.0, 0.0, 0.0], [xy, np.sqrt(1 - xy**2), 0.0], [xz, yz, np.sqrt(max(0.0, 1 - xz**2 - yz**2))]]
        )
        return a @ axes.T
