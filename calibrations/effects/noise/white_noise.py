from calibrations.effects import Effect, Parameter, Values
from calibrations.spectrum import Bands
from calibrations.table import Array


class WhiteNoise(Effect):
    """white-noise: each sample has an independent error; its sum over time is an angle or velocity random walk.

        S(f) = N^2, Allan deviation N / sqrt(tau)      N in {out}/sqrt(Hz)

    The density is two-sided, like the coefficient of the Allan deviation; data sheets give the one-sided density, which
    is sqrt(2) times N.

    Symptom   the spectrum is level, and the Allan deviation falls as one over the root of the averaging time.
    Excited by  any still record; a longer one gives a smaller uncertainty.
    Confused with  gauss-markov-noise with a time constant near the sampling interval. To separate them, sample faster.
    Source    Book 17.3, (17.4): angle (velocity) random walk; IEEE Std 952, annex C; IEEE Std 1293.
    """

    kinds = ("still",)

    coefficient = Parameter("{out}/sqrt(Hz)", typical=1e-4, low=0.0, doc="N: Allan deviation at 1 s of white noise")

    def spectrum(self, at: Bands, p: Values) -> Array:
        return p.coefficient**2 * at.column("white-noise")
