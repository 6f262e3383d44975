"""The mean of samples that a converter rounds to its codes.

Source  Widrow and Kollar, Quantization Noise (2008), chapter 4.
"""

from __future__ import annotations

import numpy as np
import scipy  # its room of special functions is loaded where it is first entered

from calibrations.table import Array

CODES = 3  # to either side of the nearest one, that noise may reach


def mean_of_rounded(values: Array, step: float, offset: float, noise: float) -> Array:
    """Means of rounded samples about `values`, exactly; codes stand at offset + m step. All in the output's unit.

    noise   standard deviation of a normal sample before it is rounded, > 0 and at most half a step
    """
    codes = (values - offset) / step
    nearest = np.round(codes)
    deviation, spread = codes - nearest, noise / step
    mean = nearest
    for j in range(CODES):
        above, below = (deviation - 0.5 - j) / spread, (-deviation - 0.5 - j) / spread
        mean = mean + scipy.special.ndtr(above) - scipy.special.ndtr(below)
    return np.asarray(offset + step * mean)
