"""sampling-delay: the sensor's samples are older than the displacement's beside them.

    V(t) <- V(t - d)                                  d in s, one per axis: each channel is sampled in its turn

Symptom   what follows the motion comes late, of the right size, the more the higher its frequency.
Excited by  any motion; at one frequency it is told from output-filter only where the scale factor is known.
Confused with  output-filter, at one frequency; motion at another frequency tells them apart.
Source    Ang V (interferometer and sensor sampled at 1 kHz); ISO 16063-21, phase of the measuring chain.
"""

from calibrations.effect import Parameter, Values
from calibrations.motion.output import filtered
from calibrations.motion.spectrum import delayed
from calibrations.table import Array, Table

KINDS = ("motion",)
LEFT_OUT = "it is a matter of time, and belongs to the sampling"
PARAMETERS = (Parameter("delay", "s", typical=1e-3, low=-0.05, high=0.05, doc="age of the sensor's samples"),)


def output(v: Array, table: Table, p: Values) -> Array:
    return filtered(v, table, lambda k: delayed(float(p["delay"][k])))
