"""bias: the output at zero specific force.

    V += B                                            B in {out}, one per axis; IEEE K0

Symptom   the whole residual stands off zero.
Excited by  any data.
Confused with  the squares of all axes together: in a field of 1 g they add up to a constant. Motion tells them apart.
Source    Ang (2); Book 17.3.6; IEEE Std 1293, K0.
"""

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

PARAMETERS = (Parameter("bias", "{out}", typical=5.0, doc="output at zero specific force"),)
STARTS = {"bias": lambda table: (table.outputs.max(axis=0) + table.outputs.min(axis=0)) / 2}


def transduction(a: Array, table: Table, p: Values) -> Array:
    return np.broadcast_to(p["bias"], a.shape)
