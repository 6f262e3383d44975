"""field-strength: the strength of the local field, in units of the output.

    V += F m                                          m: direction of the field, a unit vector; F in {out}, one for all

Symptom   the whole magnitude of the output stands off what was assumed.
Excited by  any data.
Confused with  a scale factor that all axes share: the output of a magnetometer is calibrated by a field that is known.
Source    Book (17.6).
"""

import numpy as np

from calibrations.coverage import radius
from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

KINDS = ("fields",)
PARAMETERS = (Parameter("total", "{out}", typical=1.0, per_axis=False, starts=(1.0,), low=1e-12, doc="F (17.6)"),)
STARTS = {"total": lambda table: np.full(3, radius(table))}


def transduction(a: Array, table: Table, p: Values) -> Array:
    return a * p["total"]
