from calibrations.effects import Effect, Parameter, Values
from calibrations.geometry.orientation import other_in_plane
from calibrations.table import Array, Table


class CrossAxisBias(Effect):
    """cross-axis-bias: the bias follows the square of the other in-plane axis.

        V += p2 a_p^2                                     p2 in {out}/g^2, one per axis; IEEE K_pp = p2 / K1

    Symptom   the residual is largest where the other in-plane axis is vertical, with the same sign up and down.
    Excited by  a full turn of beta at alpha = 90 deg.
    Confused with  quadratic-nonlinearity, if only one inclination was measured: the sum of both squares is constant.
    Source    Ang (11), p2; IEEE Std 1293, K_pp.
    """

    of_force = True
    square = Parameter("{out}/g^2", typical=0.02, doc="output per square of the other in-plane axis")

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        return other_in_plane(a) ** 2 * p.square
