"""flicker-noise: the output wanders alike at every time scale, as electronics does.

    S(f) = B^2 / (2 pi |f|), Allan deviation sqrt(2 ln 2 / pi) B = 0.664 B      B in {out}: bias instability

Symptom   the Allan deviation stays level where averaging should still help.
Excited by  a still record that is many times longer than the time where white noise and flicker are equal.
Confused with  gauss-markov-noise and rate-random-walk where a record has few periods of it; a longer record tells.
Source    Book 17.3: flicker noise; IEEE Std 952, annex C; Kasdin, Proc. IEEE 83 (1995).
"""

from calibrations.effect import Parameter, Values
from calibrations.noise_analysis.bands import Bands
from calibrations.table import Array

KINDS = ("still",)
PARAMETERS = (Parameter("coefficient", "{out}", typical=1e-4, low=0.0, doc="B: bias instability"),)


def spectrum(at: Bands, p: Values) -> Array:
    return p["coefficient"] ** 2 * at.column("flicker-noise")
