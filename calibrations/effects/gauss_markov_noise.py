"""gauss-markov-noise: the output wanders, and comes back within a time constant; a trap in a transistor does so.

    S(f) = 2 s^2 T / (1 + (2 pi f T)^2), largest Allan deviation 0.62 s at 1.9 T      s in {out}, T in s

Symptom   the Allan deviation has a hump, the spectrum a shoulder.
Excited by  a still record of twenty time constants or more, sampled several times in each.
Confused with  flicker-noise, of which a short record shows one hump; rate-random-walk, which it is at times below T.
Source    Book 17.3: low-frequency noise as Gauss-Markov process; IEEE Std 952, annex C: exponentially correlated noise;
          Machlup, J. Appl. Phys. 25 (1954): the same spectrum of a random telegraph signal.
"""

import numpy as np

from calibrations.effect import Parameter, Values
from calibrations.noise_analysis.bands import Bands
from calibrations.still.record import Channel
from calibrations.table import Array

KINDS = ("still",)
CONTAINS = ("rate-random-walk",)  # at times below T
PARAMETERS = (
    Parameter("sigma", "{out}", typical=1e-4, low=0.0, doc="s: standard deviation"),
    Parameter("time_constant", "s", typical=10.0, low=0.0, doc="T: after which it has forgotten all but 1/e"),
)
TRIED = 12  # time constants
FASTEST, LONGEST = 3.0, 0.1  # of them, in sampling intervals and in lengths of the record


def _times_s(record: Channel) -> Array:
    """Time constants that a record can show, and its filter does not hide."""
    shortest = max(FASTEST / record.rate_hz, 1 / record.corner_hz)
    return np.geomspace(shortest, max(LONGEST * record.length_s, 2 * shortest), TRIED)


STARTS = {"time_constant": _times_s}


def spectrum(at: Bands, p: Values) -> Array:
    return p["sigma"] ** 2 * at.column("gauss-markov-noise", float(np.asarray(p["time_constant"])))
