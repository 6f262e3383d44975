"""saturation: beyond a level the output follows the specific force less, or no more.

    V <- V - c (V - high)   above high,   V - c (V - low)   below low     levels in {out}, one per axis; c from 0 to 1

Symptom   the residual bends away at the greatest outputs, to one side or to both.
Excited by  specific force close to the end of the axis's range.
Confused with  cubic-nonlinearity, which bends everywhere; positions between the extremes tell them apart.
Source    IEEE Std 528, saturation and full-scale input; ADXL203 data sheet, output swing.
"""

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

KINDS = ("poses",)
AFTER = ("bias", "scale-factor")
PARAMETERS = (
    Parameter("high", "{out}", typical=0.1, doc="level above which it begins"),
    Parameter("low", "{out}", typical=0.1, doc="level below which it begins"),
    Parameter("loss", "1", typical=1.0, per_axis=False, starts=(1.0,), low=0.0, high=1.0, doc="of what is beyond"),
)
INSIDE = (0.01, 0.1)  # of the range of outputs, where the levels are looked for first
STARTS = {"high": lambda table: _levels(table, 1), "low": lambda table: _levels(table, -1)}


def output(v: Array, table: Table, p: Values) -> Array:
    left: Array = v - p["loss"] * (np.maximum(v - p["high"], 0.0) + np.minimum(v - p["low"], 0.0))
    return left


def _levels(table: Table, side: int) -> Array:
    least, most = table.outputs.min(axis=0), table.outputs.max(axis=0)
    end = most if side > 0 else least
    return np.stack([end - side * share * (most - least) for share in INSIDE])
