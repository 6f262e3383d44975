import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.table import Array, Table


class OutputFilter(Effect):
    """output-filter: the corner frequency of the R-C filter at the output differs from its nominal value.

        V <- V (1 + j f / fc) / (1 + j f / (fc + d))      fc: nominal corner in Hz; d in Hz, one per axis

    Symptom   the response to motion is too small and late, or too large and early, and more so at higher frequencies.
    Excited by  motion at two frequencies or more, below and above the corner.
    Confused with  sampling-delay together with scale-factor, at one frequency. To separate them, use another frequency.
    Source    Ang V: 32 kOhm and 0.33 uF; the sensor's output resistance has a tolerance of a fifth and more.
    """

    kinds = ("motion",)
    left_out = "it depends on earlier samples: it is a filter of the sampling"

    off_nominal = Parameter("Hz", typical=2.0, low=-10.0, high=100.0, doc="corner less its nominal value")

    def output(self, v: Array, table: Table, p: Values) -> Array:
        from calibrations.motion.spectrum import corner_hz, filter_output, first_order  # only motion has spectra

        nominal = corner_hz(table)
        corners_hz = [nominal + max(float(d), -0.9 * nominal) for d in p.off_nominal]
        return filter_output(
            v, table, lambda k: lambda f: np.asarray(first_order(corners_hz[k])(f) / first_order(nominal)(f))
        )
