from calibrations.effects import Effect, Parameter, Values
from calibrations.table import Array, Table


class SamplingDelay(Effect):
    """sampling-delay: the samples of the sensor are older than the samples of the displacement.

        V(t) <- V(t - d)                                  d in s, one per axis: each channel is sampled in its turn

    Symptom   the response to motion is late but of the right size, and more so at higher frequencies.
    Excited by  any motion; at one frequency only together with a known scale factor.
    Confused with  output-filter, at one frequency. To separate them, use another frequency.
    Source    Ang V (interferometer and sensor sampled at 1 kHz); ISO 16063-21, phase of the measuring chain.
    """

    kinds = ("motion",)
    left_out = "it is a matter of time, and belongs to the sampling"

    delay = Parameter("s", typical=1e-3, low=-0.05, high=0.05, doc="age of the sensor's samples")

    def output(self, v: Array, table: Table, p: Values) -> Array:
        from calibrations.motion.spectrum import delay, filter_output  # only motion has spectra

        return filter_output(v, table, lambda k: delay(float(p.delay[k])))
