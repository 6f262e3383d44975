"""supply-sensitivity: the output follows the supply voltage.

    V <- V (1 + k (S / S0 - 1))                       k: 1 where the output is ratiometric; S0 the data's mean supply

Symptom   the residual follows the supply voltage, in proportion to the output itself.
Excited by  a run in which the supply is logged and changes.
Confused with  drift, where the supply changes steadily with time.
Source    ADXL203 data sheet (ratiometric output); IEEE Std 1293, supply voltage sensitivity.
"""

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

NEEDS = ("supply_v",)
PARAMETERS = (Parameter("share", "1", typical=1.0, doc="relative change of the output over that of the supply"),)
CONSTANTS = {"reference_v": lambda table: float(np.mean(table.column("supply_v")))}


def output(v: Array, table: Table, p: Values) -> Array:
    more = table.column("supply_v") / p["reference_v"] - 1
    return v * (1 + more[:, None] * p["share"])
