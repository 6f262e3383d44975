"""adc-nonlinearity: the converter's characteristic is not straight, the same for every channel.

    V <- V + b u^2 + c u^3      u = (V - middle) / half the span of all outputs; b and c in {out}, one for all axes

Symptom   the residual is one curve over the output voltage, whatever axis it comes from.
Excited by  at least two axes that go through the converter's range.
Confused with  quadratic-nonlinearity and cubic-nonlinearity of axes that are alike; a known voltage at the input
               tells them apart.
Source    IEEE Std 1241, integral nonlinearity.
"""

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.table import Array, Table

AFTER = ("bias", "scale-factor")
PARAMETERS = (
    Parameter("bow", "{out}", typical=0.002, per_axis=False, measured="y", doc="deviation at both ends, alike"),
    Parameter("bend", "{out}", typical=0.002, per_axis=False, measured="y", doc="deviation at both ends, opposite"),
)
CONSTANTS = {
    "middle": lambda table: float(np.min(table.outputs) + np.max(table.outputs)) / 2,
    "half_span": lambda table: float(np.ptp(table.outputs)) / 2,
}


def output(v: Array, table: Table, p: Values) -> Array:
    u = (v - p["middle"]) / p["half_span"]
    return v + p["bow"] * u**2 + p["bend"] * u**3
