"""output-filter: the corner of the R-C filter at the output is not where its nominal values put it.

    V <- V (1 + j f / fc) / (1 + j f / (fc + d))      fc: nominal corner in Hz; d in Hz, one per axis

Symptom   what follows the motion is too small and late, or too large and early, the more the higher its frequency.
Excited by  motion at two frequencies or more, on both sides of the corner.
Confused with  sampling-delay and scale-factor together, at one frequency; motion at another frequency tells them apart.
Source    Ang V: 32 kOhm and 0.33 uF; the sensor's output resistance has a tolerance of a fifth and more.
"""

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.motion.output import corner_hz, filtered
from calibrations.motion.spectrum import first_order
from calibrations.table import Array, Table

KINDS = ("motion",)
LEFT_OUT = "it follows what came before: it is a filter, and belongs to the sampling"
PARAMETERS = (Parameter("off_nominal", "Hz", typical=2.0, low=-10.0, high=100.0, doc="corner less its nominal value"),)


def output(v: Array, table: Table, p: Values) -> Array:
    nominal = corner_hz(table)
    moved = [nominal + max(float(d), -0.9 * nominal) for d in p["off_nominal"]]
    return filtered(v, table, lambda k: lambda f: np.asarray(first_order(moved[k])(f) / first_order(nominal)(f)))
