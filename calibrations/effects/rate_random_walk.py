"""rate-random-walk: the bias itself walks at random, by steps without end.

    S(f) = K^2 / (2 pi f)^2, Allan deviation K sqrt(tau / 3)      K in {out}/sqrt(s)

Symptom   the Allan deviation rises as the root of the averaging time: the longer, the worse.
Excited by  a still record that is several times longer than the time where the Allan deviation is lowest.
Confused with  flicker-noise and slow gauss-markov-noise where a record has few periods of it; a drift in a straight
               line, which never turns round; a longer record tells.
Source    Book 17.3, (17.5): rate random walk; IEEE Std 952, annex C.
"""

from calibrations.effect import Parameter, Values
from calibrations.noise_analysis.bands import Bands
from calibrations.table import Array

KINDS = ("still",)
PARAMETERS = (
    Parameter("coefficient", "{out}/sqrt(s)", typical=1e-6, low=0.0, doc="K: by how much it walks in 1 s, rms"),
)


def spectrum(at: Bands, p: Values) -> Array:
    return p["coefficient"] ** 2 * at.column("rate-random-walk")
