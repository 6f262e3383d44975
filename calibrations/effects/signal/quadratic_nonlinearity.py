from calibrations.effects import Effect, Parameter, Values
from calibrations.table import Array, Table


class QuadraticNonlinearity(Effect):
    """quadratic-nonlinearity: the output follows the square of the specific force along its own axis.

        V += k a_i^2                                      k in {out}/g^2, one per axis; IEEE K2 = k / K1

    Symptom   the residual is a parabola over the specific force of its own axis, with the same sign on both sides.
    Excited by  inclinations that take the axis from -1 g through 0 to +1 g.
    Confused with  cross-axis-bias and z-axis-bias together: in a field of 1 g the sum of the three squares is constant.
    Source    Book 17.3.10; IEEE Std 1293, K2.
    """

    of_force = True
    square = Parameter("{out}/g^2", typical=0.02, doc="output per square of the own axis")

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        return a**2 * p.square
