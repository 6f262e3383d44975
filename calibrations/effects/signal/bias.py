import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.geometry.orientation import reported_force
from calibrations.table import Array, Table


def _zero_output(table: Table) -> Array:
    """The middle of each output; in a table of motion less what gravity gives there."""
    middle: Array = (table.outputs.max(axis=0) + table.outputs.min(axis=0)) / 2
    if table.type.moving:
        gravity = reported_force(table)[:, : len(middle)]
        return np.asarray(middle - table.number("output_per_g", 0.0) * gravity.mean(axis=0))
    return middle


class Bias(Effect):
    """bias: the output at zero specific force.

        V += B                                            B in {out}, one per axis; IEEE K0

    Symptom   the mean of the residual is not zero.
    Excited by  any data.
    Confused with  the squares of all axes together: in a field of 1 g their sum is constant. To separate them, use
              motion.
    Source    Ang (2); Book 17.3.6; IEEE Std 1293, K0.
    """

    bias = Parameter("{out}", typical=5.0, guess=_zero_output, doc="output at zero specific force")

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        return np.broadcast_to(p.bias, a.shape)
