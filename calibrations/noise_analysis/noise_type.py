"""The power law that noise follows, from the correlation of neighbouring means.

The spectrum of the values goes as f^alpha. Fractionally integrated noise of order d < 1/2 has the lag-1 autocorrelation
d / (1 - d), and alpha = -2 d; noise that is redder is differenced first.

Source  Riley and Greenhall, Proc. 18th EFTF (2004); NIST SP 1065, 5.5.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibrations.table import Array

FEWEST = 120  # means: of fewer the correlation is too uncertain to tell a type from the next, by 2.7 standard errors
STATIONARY = 0.25  # order of integration up to which noise need not be differenced
REDDEST, BLUEST = -3, 2


def noise_type(n: int, moments: Sequence[float] | Array) -> int | None:
    """alpha, from 2 (quantisation) to -3; None where means are too few or all the same.

    n means z with the differences w: moments are the sums of z, z^2, z z', w^2 and w w' (' is the one before).
    """
    z, zz, lagged, ww, w_lagged = moments
    mean = z / n if n else 0.0
    variance = zz - n * mean**2
    if n < FEWEST or not variance > 1e-12 * zz or not ww > 0:
        return None
    order = _order((lagged - (n - 1) * mean**2) / variance)
    if order >= STATIONARY:
        order = 1 + _order(w_lagged / ww)
    return int(np.clip(round(-2 * order), REDDEST, BLUEST))


def moments_of(z: Array) -> tuple[float, float, float, float, float]:
    """The sums that `noise_type` takes, of means shape (n,)."""
    w = np.diff(z)
    return float(z.sum()), float(z @ z), float(z[1:] @ z[:-1]), float(w @ w), float(w[1:] @ w[:-1])


def _order(correlation: float) -> float:
    return correlation / (1 + correlation) if correlation > -1 else -1.0
