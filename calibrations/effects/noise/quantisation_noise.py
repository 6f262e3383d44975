from calibrations.effects import Effect, Parameter, Values
from calibrations.spectrum import Bands
from calibrations.table import Array


class QuantisationNoise(Effect):
    """quantisation-noise: the output is the increment of a coarsely counted sum over time.

        S(f) = (2 sin(pi f dt))^2 Q^2 / dt, Allan deviation sqrt(3) Q / tau      Q in {out} s, dt: sampling interval

    An angle or a velocity that is read in coarse steps has this noise. A converter that rounds each sample
    independently makes white noise.

    Symptom   the spectrum rises with the square of the frequency; the Allan deviation falls as one over the time.
    Excited by  a still record at the full rate of the sensor; a slow filter hides it behind the noise of the converter.
    Confused with  nothing else in the catalogue rises with frequency.
    Source    Book 17.3: quantisation noise; IEEE Std 952, annex C.
    """

    kinds = ("still",)

    coefficient = Parameter("{out}*s", typical=1e-6, low=0.0, doc="Q: rms error of the sum over time")

    def spectrum(self, at: Bands, p: Values) -> Array:
        return p.coefficient**2 * at.column("quantisation-noise")
