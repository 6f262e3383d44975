"""quantisation-noise: the output is what a coarse counter of its sum over time grew by from sample to sample.

    S(f) = (2 sin(pi f dt))^2 Q^2 / dt, Allan deviation sqrt(3) Q / tau      Q in {out} s, dt: sampling interval

It is that of an angle or a velocity that is read coarsely. A converter that rounds each sample by itself makes white
noise.

Symptom   the spectrum rises with the square of the frequency; the Allan deviation falls as one over the time.
Excited by  a still record at the sensor's full rate; behind a slow filter it cannot be told from the converter's noise.
Confused with  nothing else in the catalogue that rises with frequency.
Source    Book 17.3: quantisation noise; IEEE Std 952, annex C.
"""

from calibrations.effect import Parameter, Values
from calibrations.noise_analysis.bands import Bands
from calibrations.table import Array

KINDS = ("still",)
PARAMETERS = (Parameter("coefficient", "{out}*s", typical=1e-6, low=0.0, doc="Q: rms error of the sum over time"),)


def spectrum(at: Bands, p: Values) -> Array:
    return p["coefficient"] ** 2 * at.column("quantisation-noise")
