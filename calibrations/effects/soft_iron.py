"""soft-iron: iron that turns with the sensor bends the field: the sphere of its directions becomes an ellipsoid.

    m <- (1 + E) m            E = ((xx, xy, xz), (xy, yy, yz), (xz, yz, -xx - yy)), relative; the mean is field-strength

Symptom   the magnitude has two hills and two valleys in a full turn.
Excited by  orientations that spread over the sphere: three full turns about different axes at least.
Confused with  unequal scale factors and axes that are not at right angles, of the sensor itself: they are in it.
Source    Book 17.5, (17.11)-(17.15); Renaudin, Afzal and Lachapelle, Journal of Sensors (2010).
"""

import numpy as np

from calibrations.coverage import SOFT_IRON, too_small
from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

KINDS = ("fields",)
EXACT = True
PARAMETERS = (
    Parameter("xx", "1", typical=0.1, per_axis=False, doc="gain along x over the mean of the three"),
    Parameter("yy", "1", typical=0.1, per_axis=False, doc="gain along y over the mean of the three"),
    Parameter("xy", "1", typical=0.1, per_axis=False, doc="field along y that x shows, and along x that y shows"),
    Parameter("xz", "1", typical=0.1, per_axis=False, doc="the same of x and z"),
    Parameter("yz", "1", typical=0.1, per_axis=False, doc="the same of y and z"),
)
LACKS = lambda table: too_small(table, SOFT_IRON)  # noqa: E731


def force(a: Array, table: Table, p: Values) -> Array:
    bent: Array = np.array(
        [
            [1 + p["xx"], p["xy"], p["xz"]],
            [p["xy"], 1 + p["yy"], p["yz"]],
            [p["xz"], p["yz"], 1 - p["xx"] - p["yy"]],
        ]
    )
    return a @ bent
