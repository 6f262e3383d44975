"""quadratic-nonlinearity: the output follows the square of the specific force along the axis itself.

    V += k a_i^2                                      k in {out}/g^2, one per axis; IEEE K2 = k / K1

Symptom   the residual is a parabola over the axis's own specific force, the same for both signs.
Excited by  inclinations that bring the axis from -1 g over 0 to +1 g.
Confused with  cross-axis-bias and z-axis-bias together: in a field of 1 g the three squares add up to a constant.
Source    Book 17.3.10; IEEE Std 1293, K2.
"""

from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

PARAMETERS = (Parameter("square", "{out}/g^2", typical=0.02, doc="output per square of the own axis"),)


def transduction(a: Array, table: Table, p: Values) -> Array:
    return a**2 * p["square"]
