"""z-axis-bias: the bias follows the square of the out-of-plane axis.

    V += q2 a_o^2                                     q2 in {out}/g^2, one per axis; IEEE K_oo = q2 / K1

Symptom   the residual shifts as a whole from one inclination to the next.
Excited by  at least three inclinations alpha; both ends of the range.
Confused with  bias, at one inclination; drift, where inclinations rise with time.
Source    Ang (13), q2; IEEE Std 1293, K_oo.
"""

from calibrations.axes import out_of_plane
from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

PARAMETERS = (Parameter("square", "{out}/g^2", typical=0.05, doc="output per square of the out-of-plane axis"),)


def transduction(a: Array, table: Table, p: Values) -> Array:
    return out_of_plane(a) ** 2 * p["square"]
