"""Robust scale: a standard deviation that outliers hardly change.

Source  Huber and Ronchetti, Robust Statistics (2009), chapter 5: the median absolute deviation.
"""

from __future__ import annotations

import numpy as np

from calibrations.table import Array

TO_STD = 1.4826  # median absolute deviation of normal values to their standard deviation


def robust_std(deviations: Array, axis: int | None = None) -> Array:
    """Standard deviation from the median of the sizes of `deviations` from their centre, along `axis` or of all."""
    return np.asarray(TO_STD * np.median(np.abs(deviations), axis=axis))
