from calibrations.effects import Effect, Parameter, Values
from calibrations.geometry.orientation import out_of_plane
from calibrations.table import Array, Table


class ZAxisBias(Effect):
    """z-axis-bias: the bias follows the square of the out-of-plane axis.

        V += q2 a_o^2                                     q2 in {out}/g^2, one per axis; IEEE K_oo = q2 / K1

    Symptom   the mean of the residual differs between inclinations.
    Excited by  three inclinations alpha or more, including both ends of the range.
    Confused with  bias, at one inclination; drift, if the inclinations rise with time.
    Source    Ang (13), q2; IEEE Std 1293, K_oo.
    """

    of_force = True
    square = Parameter("{out}/g^2", typical=0.05, doc="output per square of the out-of-plane axis")

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        return out_of_plane(a) ** 2 * p.square
