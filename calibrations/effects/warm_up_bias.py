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

KINDS = ("poses", "positions")
NEEDS = ("t_s",)
PARAMETERS = (
    Parameter("amplitude", "{out}", typical=0.01, doc="bias at the record's beginning less the final one"),
    Parameter("time_constant", "s", typical=600.0, per_axis=False, starts=(600.0,), low=1e-3, doc="of the exponential"),
)
PARTS = (0.05, 0.2, 0.6)  # of the record's length: time constants to begin with
STARTS = {"time_constant": lambda table: np.outer(PARTS, np.full(len(table.axes), np.ptp(table.time_s)))}
CONSTANTS = {"begin_s": lambda table: float(np.min(table.time_s))}


def transduction(a: Array, table: Table, p: Values) -> Array:
    left = np.exp(-(table.time_s - p["begin_s"]) / p["time_constant"])
    return np.outer(left, p["amplitude"])
