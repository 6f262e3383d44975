import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.table import Array, Table

INSIDE = (0.01, 0.1)  # of the range of outputs, where the levels are looked for first
KNEE = 0.003  # of the range of outputs: the width of the bend where a fit starts


class Saturation(Effect):
    """saturation: above a level the output follows the specific force less, or not at all.

        V <- V - c e(V - high) + c e(low - V)      e(u) = w ln(1 + exp(u / w)): u above 0, nothing below, with a bend
        levels in {out}, one per axis; c from 0 to 1; w, the width of the bend, in {out}; a corner where w is 0

    Symptom   the residual bends at the largest outputs, on one side or on both.
    Excited by  specific force close to the end of the range of the axis.
    Confused with  cubic-nonlinearity, which bends everywhere. To separate them, measure between the extremes.
    Source    IEEE Std 528, saturation and full-scale input; ADXL203 data sheet, output swing.
    """

    kinds = ("poses",)
    after = ("bias", "scale-factor")
    converts = True

    high = Parameter("{out}", typical=0.1, guess=lambda table: _levels(table, 1), doc="level above which it begins")
    low = Parameter("{out}", typical=0.1, guess=lambda table: _levels(table, -1), doc="level below which it begins")
    loss = Parameter("1", typical=1.0, per_axis=False, starts=(1.0,), low=0.0, high=1.0, doc="of what is beyond")

    knee = Parameter(
        "{out}", typical=0.01, per_axis=False, low=0.0, assumed=0.0,
        guess=lambda table: np.full(len(table.axes), KNEE * float(np.max(np.ptp(table.outputs, axis=0)))),
        doc="width of the bend at a level; 0: a corner",
    )  # fmt: skip

    def output(self, v: Array, table: Table, p: Values) -> Array:
        limited: Array = v - p.loss * (beyond(v - p.high, float(p.knee)) - beyond(p.low - v, float(p.knee)))
        return limited


def beyond(excess: Array, knee: float) -> Array:
    """The part of an excess above 0, in its unit, with a bend of width `knee` at 0 (0: a corner)."""
    part: Array = np.maximum(excess, 0.0)
    if knee > 0:
        part = part + knee * np.log(1.0 + np.exp(-np.abs(excess) / knee))
    return part


def _levels(table: Table, side: int) -> Array:
    least, most = table.outputs.min(axis=0), table.outputs.max(axis=0)
    end = most if side > 0 else least
    return np.stack([end - side * share * (most - least) for share in INSIDE])
