"""bias: the output at zero specific force.

    V += B                                            B in {out}, one per axis; IEEE K0

Symptom   the whole residual stands off zero.
Excited by  any data.
Confused with  the squares of all axes together: in a field of 1 g they add up to a constant. Motion tells them apart.
Source    Ang (2); Book 17.3.6; IEEE Std 1293, K0.
"""

import numpy as np

from calibrations.chain import nominal_pose, specific_force
from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

PARAMETERS = (Parameter("bias", "{out}", typical=5.0, doc="output at zero specific force"),)


def _at_zero(table: Table) -> Array:
    """The middle of each output; in a table of motion less what gravity gives there."""
    middle: Array = (table.outputs.max(axis=0) + table.outputs.min(axis=0)) / 2
    if table.kind == "motion":
        gravity = specific_force(nominal_pose(table))[:, : len(middle)]
        return np.asarray(middle - table.number("output_per_g", 0.0) * gravity.mean(axis=0))
    return middle


STARTS = {"bias": _at_zero}


def transduction(a: Array, table: Table, p: Values) -> Array:
    return np.broadcast_to(p["bias"], a.shape)
