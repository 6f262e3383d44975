import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.table import Array, Table


class ScaleFactorAsymmetry(Effect):
    """scale-factor-asymmetry: the scale factor differs between positive and negative specific force.

        V += k |a_i|                                      k in {out}/g, one per axis; IEEE K1' = 2 k / K1

    Symptom   the residual is V-shaped over the specific force of its own axis: straight on both sides, with a kink at
              zero.
    Excited by  inclinations that take the axis from -1 g through 0 to +1 g.
    Confused with  quadratic-nonlinearity, which is round at zero. To separate them, measure at positions near 0 g.
    Source    Book 17.3.8; IEEE Std 1293, K1'.
    """

    of_force = True
    kink = Parameter("{out}/g", typical=0.01, doc="half the difference of both slopes")

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        return np.abs(a) * p.kink
