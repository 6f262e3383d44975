import numpy as np

from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.table import Array, Table


class ScaleFactorAsymmetry(Effect):
    """scale-factor-asymmetry: the scale factor differs between positive and negative specific force.

        V += k |a_i - c_i|                         k in {out}/g, c in g, one per axis; IEEE K1' = 2 k / K1

    Symptom   the residual is V-shaped over the specific force of its own axis: straight on both sides, with a kink
              near zero.
    Excited by  inclinations that take the axis from -1 g through 0 to +1 g.
    Confused with  quadratic-nonlinearity, which is round at zero. To separate them, measure at positions near 0 g.
    Source    Book 17.3.8; IEEE Std 1293, K1'.
    """

    of_force = True
    kink = Parameter("{out}/g", typical=0.01, doc="half the difference of both slopes")
    centre = Parameter("g", typical=0.01, low=-0.5, high=0.5, where="centred", assumed=0.0, doc="force at the kink")
    # In a motion at few attitudes, a kink at any force would be an offset at one of them.
    centred = Constant(lambda table: float(table.kind == "poses"), doc="the kink is sought (1: yes, 0: it is at 0 g)")

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        return np.abs(a - p.centre) * p.kink
