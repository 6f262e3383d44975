"""dead-zone: specific force below a threshold gives no output, and is missing from what is above it.

    a_i <- a_i - w_i for a_i > w_i,   a_i + w_i for a_i < -w_i,   0 between          w in g, one per axis

Symptom   the residual jumps where the axis's own specific force changes its sign, and is flat on either side.
Excited by  positions close to 0 g on both sides, and others far from it.
Confused with  hysteresis of small reach, which jumps elsewhere on the way up than on the way down.
Source    Book 17.3.11; IEEE Std 528, dead band.
"""

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

KINDS = ("poses", "motion")
PARAMETERS = (
    Parameter("width", "g", typical=0.01, starts=(0.003, 0.05), low=0.0, high=0.5, doc="greatest without output"),
)


def force(a: Array, table: Table, p: Values) -> Array:
    return a - np.clip(a, -p["width"], p["width"])
