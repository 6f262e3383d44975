"""cubic-nonlinearity: the output follows the cube of the specific force along the axis itself.

    V += k a_i^3                                      k in {out}/g^3, one per axis; IEEE K3 = k / K1

Symptom   the residual is an S over the axis's own specific force, of opposite sign for opposite force.
Excited by  inclinations that bring the axis from -1 g over 0 to +1 g.
Confused with  odd-quadratic-nonlinearity, which has the same S with another curvature at zero; z-axis-scale.
Source    Book 17.3.10; IEEE Std 1293, K3.
"""

from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

PARAMETERS = (Parameter("cube", "{out}/g^3", typical=0.01, doc="output per cube of the own axis"),)


def transduction(a: Array, table: Table, p: Values) -> Array:
    return a**3 * p["cube"]
