"""cross-axis-bias: the bias follows the square of the other in-plane axis.

    V += p2 a_p^2                                     p2 in {out}/g^2, one per axis; IEEE K_pp = p2 / K1

Symptom   the residual is largest where the other in-plane axis is vertical, the same for both signs.
Excited by  a full turn of beta at alpha = 90 deg.
Confused with  quadratic-nonlinearity where only one inclination was measured: the two squares add up to a constant.
Source    Ang (11), p2; IEEE Std 1293, K_pp.
"""

from calibrations.axes import other_in_plane
from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

PARAMETERS = (Parameter("square", "{out}/g^2", typical=0.02, doc="output per square of the other in-plane axis"),)


def transduction(a: Array, table: Table, p: Values) -> Array:
    return other_in_plane(a) ** 2 * p["square"]
