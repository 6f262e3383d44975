"""gyro-bias: the output of a gyroscope at zero angular rate.

    V += b                                            b in {out}, one per axis

Symptom   the whole residual stands off zero, at rest as well.
Excited by  any data.
Confused with  the earth's rotation, where its latitude is not given: 0.0042 deg/s at most.
Source    Book 17.3.6; IEEE Std 528, bias.
"""

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

KINDS = ("rates",)
PARAMETERS = (Parameter("bias", "{out}", typical=5.0, doc="output at zero angular rate"),)
STARTS = {"bias": lambda table: table.outputs[np.argmin(np.abs(table.column("rate_deg_s")))]}


def transduction(a: Array, table: Table, p: Values) -> Array:
    return np.broadcast_to(p["bias"], a.shape)
