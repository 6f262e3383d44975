from calibrations.effects import Effect, Parameter, Values
from calibrations.spectrum import Bands
from calibrations.table import Array


class RateRandomWalk(Effect):
    """rate-random-walk: the bias is a random walk, with steps that do not return.

        S(f) = K^2 / (2 pi f)^2, Allan deviation K sqrt(tau / 3)      K in {out}/sqrt(s)

    Symptom   the Allan deviation rises as the root of the averaging time.
    Excited by  a still record several times longer than the time at which the Allan deviation is lowest.
    Confused with  flicker-noise and slow gauss-markov-noise, if the record holds few periods; a drift in a straight
              line, which never reverses. To separate them, record longer.
    Source    Book 17.3, (17.5): rate random walk; IEEE Std 952, annex C.
    """

    kinds = ("still",)

    coefficient = Parameter("{out}/sqrt(s)", typical=1e-6, low=0.0, doc="K: by how much it walks in 1 s, rms")

    def spectrum(self, at: Bands, p: Values) -> Array:
        return p.coefficient**2 * at.column("rate-random-walk")
