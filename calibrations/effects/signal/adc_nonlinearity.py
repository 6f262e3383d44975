import numpy as np

from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.table import Array, Table


class AdcNonlinearity(Effect):
    """adc-nonlinearity: the characteristic of the converter is not straight, and is the same for every channel.

        V <- V + b u^2 + c u^3      u = (V - middle) / half the span of all outputs; b and c in {out}, one for all axes

    Symptom   the residual is one curve over the output voltage, the same for all axes.
    Excited by  two axes or more whose outputs cross the range of the converter.
    Confused with  quadratic-nonlinearity and cubic-nonlinearity, if all axes have the same values. To separate them,
              apply a known voltage to the input.
    Source    IEEE Std 1241, integral nonlinearity.
    """

    after = ("bias", "scale-factor")
    converts = True

    bow = Parameter("{out}", typical=0.002, per_axis=False, measured="y", doc="deviation at both ends, alike")
    bend = Parameter("{out}", typical=0.002, per_axis=False, measured="y", doc="deviation at both ends, opposite")
    middle = Constant(lambda table: float(np.min(table.outputs) + np.max(table.outputs)) / 2, doc="middle of outputs")
    half_span = Constant(lambda table: float(np.ptp(table.outputs)) / 2, doc="half of their range")

    def output(self, v: Array, table: Table, p: Values) -> Array:
        u = (v - p.middle) / p.half_span
        return v + (p.bow + p.bend * u) * u * u
