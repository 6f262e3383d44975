from calibrations.effects import Effect, Parameter, Values
from calibrations.table import Array, Table


class CubicNonlinearity(Effect):
    """cubic-nonlinearity: the output follows the cube of the specific force along its own axis.

        V += k a_i^3                                      k in {out}/g^3, one per axis; IEEE K3 = k / K1

    Symptom   the residual is an S-shaped curve over the specific force of its own axis, with opposite signs for
              opposite forces.
    Excited by  inclinations that take the axis from -1 g through 0 to +1 g.
    Confused with  odd-quadratic-nonlinearity, which has an S shape with a different curvature at zero; z-axis-scale.
    Source    Book 17.3.10; IEEE Std 1293, K3.
    """

    of_force = True
    cube = Parameter("{out}/g^3", typical=0.01, doc="output per cube of the own axis")

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        return a**3 * p.cube
