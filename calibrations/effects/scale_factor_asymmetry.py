"""scale-factor-asymmetry: the scale factor differs between positive and negative specific force.

    V += k |a_i|                                      k in {out}/g, one per axis; IEEE K1' = 2 k / K1

Symptom   the residual is a V over the axis's own specific force: straight on both sides, with a kink at zero.
Excited by  inclinations that bring the axis from -1 g over 0 to +1 g.
Confused with  quadratic-nonlinearity, which is round where this has its kink; poses near 0 g tell them apart.
Source    Book 17.3.8; IEEE Std 1293, K1'.
"""

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

PARAMETERS = (Parameter("kink", "{out}/g", typical=0.01, doc="half the difference of both slopes"),)


def transduction(a: Array, table: Table, p: Values) -> Array:
    return np.abs(a) * p["kink"]
