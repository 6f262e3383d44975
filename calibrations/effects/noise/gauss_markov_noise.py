from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from calibrations.effects import Effect, Parameter, Values
from calibrations.spectrum import Bands
from calibrations.table import Array

if TYPE_CHECKING:
    from calibrations.noise.record import Channel

TIME_CONSTANTS = 12  # time constants
FASTEST, LONGEST = 3.0, 0.1  # of them, in sampling intervals and in lengths of the record


def _times_s(record: Channel) -> Array:
    """Time constants that a record can show, and its filter does not hide."""
    shortest = max(FASTEST / record.rate_hz, 1 / record.corner_hz)
    return np.geomspace(shortest, max(LONGEST * record.length_s, 2 * shortest), TIME_CONSTANTS)


class GaussMarkovNoise(Effect):
    """gauss-markov-noise: the output wanders and returns within a time constant, as with a trap in a transistor.

        S(f) = 2 s^2 T / (1 + (2 pi f T)^2), largest Allan deviation 0.62 s at 1.9 T      s in {out}, T in s

    Symptom   the Allan deviation has a hump, and the spectrum a shoulder.
    Excited by  a still record of twenty time constants or more, with several samples in each.
    Confused with  flicker-noise, if the record is short; rate-random-walk, which it equals at times below T.
    Source    Book 17.3: low-frequency noise as Gauss-Markov process; IEEE Std 952, annex C: exponentially correlated
              noise; Machlup, J. Appl. Phys. 25 (1954): the same spectrum of a random telegraph signal.
    """

    kinds = ("still",)
    contains = ("rate-random-walk",)  # at times below T

    sigma = Parameter("{out}", typical=1e-4, low=0.0, doc="s: standard deviation")
    time_constant = Parameter(
        "s", typical=10.0, low=0.0, guess=_times_s, doc="T: after which it has forgotten all but 1/e"
    )

    def spectrum(self, at: Bands, p: Values) -> Array:
        return p.sigma**2 * at.column("gauss-markov-noise", float(np.asarray(p.time_constant)))
