"""warm-up-scale: after power-on the scale factor settles exponentially.

    V += A_i exp(-(t - t0) / tau) a_i      A in {out}/g, one per axis; tau in s; t0: the record's beginning

Symptom   the residual falls off with time, in proportion to the axis's own specific force.
Excited by  a record that begins soon after power-on, with +1 g and -1 g on each axis all along it.
Confused with  temperature-scale while the sensor warms, which a hold at constant temperature tells apart.
Source    Ang III.B; Barshan and Durrant-Whyte (1995); IEEE Std 528, warm-up time.
"""

from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table
from calibrations.warm_up import TIME_CONSTANT, begin_s, left, time_constants_s

KINDS = ("poses", "positions")
NEEDS = ("t_s",)
PARAMETERS = (
    Parameter("amplitude", "{out}/g", typical=0.01, doc="scale factor at the record's beginning less the final one"),
    TIME_CONSTANT,
)
STARTS = {"time_constant": time_constants_s}
CONSTANTS = {"begin_s": begin_s}


def transduction(a: Array, table: Table, p: Values) -> Array:
    return left(table, p)[:, None] * a * p["amplitude"]
