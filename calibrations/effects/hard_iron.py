"""hard-iron: a magnet that turns with the sensor adds a constant field.

    V += h                                            h in {out}, one per axis; the sensor's own zero offset is in it

Symptom   the magnitude is larger to one side and smaller to the other: circles and spheres are off centre.
Excited by  orientations to all sides; a horizontal turn shows two of the three components.
Confused with  soft-iron, where orientations keep to one side of the sphere.
Source    Book 17.5, Fig. 17.12; Renaudin, Afzal and Lachapelle, Journal of Sensors (2010).
"""

import numpy as np

from calibrations.coverage import HARD_IRON, too_small
from calibrations.effect import Parameter, Values
from calibrations.reading.stills import sphere_centre
from calibrations.table import Array, Table

KINDS = ("fields",)
EXACT = True
PARAMETERS = (Parameter("offset", "{out}", typical=0.5, doc="constant field that turns with the sensor"),)
STARTS = {"offset": lambda table: sphere_centre(table.outputs)}
LACKS = lambda table: too_small(table, HARD_IRON)  # noqa: E731


def transduction(a: Array, table: Table, p: Values) -> Array:
    return np.broadcast_to(p["offset"], a.shape)
