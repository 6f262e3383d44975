"""warm-up-bias: after power-on the zero-g output settles exponentially.

    V += A_i exp(-(t - t0) / tau)          A in {out}, one per axis; tau in s; t0: the record's beginning

Symptom   the residual falls off with time, the same at every angle, fast at first.
Excited by  a record that begins soon after power-on and outlasts the time constant.
Confused with  temperature-bias while the sensor warms; bias-drift where the record is short. A hold at constant
               temperature, or a soak, tells them apart.
Source    Ang III.B and Fig. 10; Barshan and Durrant-Whyte (1995); IEEE Std 528, warm-up time.
"""

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table
from calibrations.warm_up import TIME_CONSTANT, begin_s, left, time_constants_s

KINDS = ("poses", "positions", "fields", "rates")
NEEDS = ("t_s",)
PARAMETERS = (
    Parameter("amplitude", "{out}", typical=0.01, doc="bias at the record's beginning less the final one"),
    TIME_CONSTANT,
)
STARTS = {"time_constant": time_constants_s}
CONSTANTS = {"begin_s": begin_s}


def transduction(a: Array, table: Table, p: Values) -> Array:
    return np.outer(left(table, p), p["amplitude"])
