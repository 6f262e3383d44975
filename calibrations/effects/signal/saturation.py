import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.table import Array, Table

INSIDE = (0.01, 0.1)  # of the range of outputs, where the levels are looked for first


class Saturation(Effect):
    """saturation: above a level the output follows the specific force less, or not at all.

        V <- V - c (V - high)   above high      V <- V - c (V - low)   below low
        levels in {out}, one per axis; c from 0 to 1

    Symptom   the residual bends at the largest outputs, on one side or on both.
    Excited by  specific force close to the end of the range of the axis.
    Confused with  cubic-nonlinearity, which bends everywhere. To separate them, measure between the extremes.
    Source    IEEE Std 528, saturation and full-scale input; ADXL203 data sheet, output swing.
    """

    kinds = ("poses",)
    after = ("bias", "scale-factor")

    high = Parameter("{out}", typical=0.1, guess=lambda table: _levels(table, 1), doc="level above which it begins")
    low = Parameter("{out}", typical=0.1, guess=lambda table: _levels(table, -1), doc="level below which it begins")
    loss = Parameter("1", typical=1.0, per_axis=False, starts=(1.0,), low=0.0, high=1.0, doc="of what is beyond")

    def output(self, v: Array, table: Table, p: Values) -> Array:
        limited: Array = v - p.loss * (np.maximum(v - p.high, 0.0) + np.minimum(v - p.low, 0.0))
        return limited


def _levels(table: Table, side: int) -> Array:
    least, most = table.outputs.min(axis=0), table.outputs.max(axis=0)
    end = most if side > 0 else least
    return np.stack([end - side * share * (most - least) for share in INSIDE])
