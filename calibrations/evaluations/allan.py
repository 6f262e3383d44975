"""Allan deviation: how much neighbouring means of a still record differ, over the time that each is taken over.

White noise falls with the square root of that time, flicker is flat, a drift rises with it.

Source  IEEE 952, annex C: overlapping estimate.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibrations.table import Array


def allan_deviation(stretches: Sequence[Array], step_s: float) -> tuple[Array, Array]:
    """(times, s, deviations) at 1, 2, 4 ... steps; stretches without gaps of means over `step_s`, shape (n,) each.

    Stretches are pooled; both are empty where none is two steps long.
    """
    longest = max((len(each) for each in stretches), default=0)
    counts = [2**k for k in range(longest.bit_length()) if 2 * 2**k <= longest]
    variances = [_variance(stretches, m) for m in counts]
    return step_s * np.array(counts, dtype=float), np.sqrt(np.array(variances))


def _variance(stretches: Sequence[Array], m: int) -> float:
    squares = np.concatenate([_differences(each, m) for each in stretches if len(each) >= 2 * m]) ** 2
    return float(squares.mean()) / 2


def _differences(means: Array, m: int) -> Array:
    """Of neighbouring means of `m` steps, at every step."""
    sums = np.concatenate([[0.0], np.cumsum(means - means.mean())])
    return np.asarray((sums[2 * m :] - 2 * sums[m:-m] + sums[: -2 * m]) / m)
