from calibrations.effects import Effect, Parameter, Values
from calibrations.spectrum import Bands
from calibrations.table import Array


class FlickerNoise(Effect):
    """flicker-noise: the output wanders equally at every time scale, as in electronics.

        S(f) = B^2 / (2 pi |f|), Allan deviation sqrt(2 ln 2 / pi) B = 0.664 B      B in {out}: bias instability

    Symptom   the Allan deviation stays level where averaging should still reduce it.
    Excited by  a still record many times longer than the time at which white noise and flicker are equal.
    Confused with  gauss-markov-noise and rate-random-walk, if the record holds few periods. To separate them, record
              longer.
    Source    Book 17.3: flicker noise; IEEE Std 952, annex C; Kasdin, Proc. IEEE 83 (1995).
    """

    kinds = ("still",)

    coefficient = Parameter("{out}", typical=1e-4, low=0.0, doc="B: bias instability")

    def spectrum(self, at: Bands, p: Values) -> Array:
        return p.coefficient**2 * at.column("flicker-noise")
