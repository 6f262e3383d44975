"""white-noise: each sample has an error of its own; summed up, an angle or a velocity walks at random.

    S(f) = N^2, Allan deviation N / sqrt(tau)      N in {out}/sqrt(Hz)

Two-sided, as the coefficient of the Allan deviation is; data sheets give the one-sided density, sqrt(2) times N.

Symptom   the spectrum is level, and the Allan deviation falls as one over the root of the averaging time.
Excited by  any still record; the longer, the better.
Confused with  gauss-markov-noise of a time constant near the sampling interval; a higher rate tells them apart.
Source    Book 17.3, (17.4): angle (velocity) random walk; IEEE Std 952, annex C; IEEE Std 1293.
"""

from calibrations.effect import Parameter, Values
from calibrations.noise_analysis.bands import Bands
from calibrations.table import Array

KINDS = ("still",)
PARAMETERS = (
    Parameter("coefficient", "{out}/sqrt(Hz)", typical=1e-4, low=0.0, doc="N: Allan deviation at 1 s of white noise"),
)


def spectrum(at: Bands, p: Values) -> Array:
    return p["coefficient"] ** 2 * at.column("white-noise")
