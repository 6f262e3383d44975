import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.table import Array, Table


class OddQuadraticNonlinearity(Effect):
    """odd-quadratic-nonlinearity: the output follows the square of the specific force, with its sign.

        V += k a_i |a_i|                                  k in {out}/g^2, one per axis; IEEE K_oq = k / K1

    Symptom   the residual is an S-shaped curve over the specific force of its own axis, with a step of curvature at
              zero.
    Excited by  inclinations that take the axis from -1 g through 0 to +1 g.
    Confused with  cubic-nonlinearity, which is smoother. To separate them, measure at positions near 0 g.
    Source    IEEE Std 1293, K_oq.
    """

    of_force = True
    square = Parameter("{out}/g^2", typical=0.01, doc="output per signed square of the own axis")

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        return a * np.abs(a) * p.square
