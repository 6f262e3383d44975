"""odd-quadratic-nonlinearity: the output follows the square of the specific force, with its sign.

    V += k a_i |a_i|                                  k in {out}/g^2, one per axis; IEEE K_oq = k / K1

Symptom   the residual is an S over the axis's own specific force, with a jump of curvature at zero.
Excited by  inclinations that bring the axis from -1 g over 0 to +1 g.
Confused with  cubic-nonlinearity, the smoother S; poses near 0 g tell them apart.
Source    IEEE Std 1293, K_oq.
"""

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

PARAMETERS = (Parameter("square", "{out}/g^2", typical=0.01, doc="output per signed square of the own axis"),)


def transduction(a: Array, table: Table, p: Values) -> Array:
    return a * np.abs(a) * p["square"]
