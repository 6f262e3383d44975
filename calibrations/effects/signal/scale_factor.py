import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.table import Array, Table


def _slope(table: Table) -> Array:
    """Half the range of each output; in a table of motion the slope over the motion."""
    spread: Array = np.ptp(table.outputs, axis=0) / 2
    return np.full(len(spread), table.number("output_per_g", 0.0)) if table.type.moving else spread


class ScaleFactor(Effect):
    """scale-factor: the output per unit of specific force.

        V += SF a                                         SF in {out}/g, one per axis; IEEE K1

    Symptom   the residual is proportional to the specific force along its own axis.
    Excited by  inclinations that bring the axis near +1 g and -1 g.
    Confused with  nothing, if the specific force has both signs.
    Source    Ang (1); Book 17.3.7; IEEE Std 1293, K1.
    """

    scale = Parameter("{out}/g", typical=1.0, starts=(1.0,), guess=_slope, doc="change of output per g")

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        return a * p.scale
