import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.geometry.sphere import SOFT_IRON, coverage_fault
from calibrations.table import Array, Table


class SoftIron(Effect):
    """soft-iron: iron that turns with the sensor distorts the field: the sphere of directions becomes an ellipsoid.

        m <- (1 + E) m      E = ((xx, xy, xz), (xy, yy, yz), (xz, yz, -xx - yy)), relative

        field-strength is the mean

    Symptom   the magnitude has two maxima and two minima in a full turn.
    Excited by  orientations spread over the sphere: three full turns about different axes or more.
    Confused with  unequal scale factors and axes that are not at right angles, of the sensor itself: E contains them.
    Source    Book 17.5, (17.11)-(17.15); Renaudin, Afzal and Lachapelle, Journal of Sensors (2010).
    """

    kinds = ("fields",)
    exact = True

    xx = Parameter("1", typical=0.1, per_axis=False, doc="gain along x over the mean of the three")
    yy = Parameter("1", typical=0.1, per_axis=False, doc="gain along y over the mean of the three")
    xy = Parameter("1", typical=0.1, per_axis=False, doc="field along y that x shows, and along x that y shows")
    xz = Parameter("1", typical=0.1, per_axis=False, doc="the same of x and z")
    yz = Parameter("1", typical=0.1, per_axis=False, doc="the same of y and z")

    def force(self, a: Array, table: Table, p: Values) -> Array:
        bent: Array = np.array(
            [
                [1 + p.xx, p.xy, p.xz],
                [p.xy, 1 + p.yy, p.yz],
                [p.xz, p.yz, 1 - p.xx - p.yy],
            ]
        )
        return a @ bent

    def lacks(self, table: Table) -> str | None:
        return coverage_fault(table, SOFT_IRON)
