"""Whether averaging for longer makes a record worse: a minimum of its Allan deviation that is no chance.

Of two variances that are as large, the ratio is distributed as F over their degrees of freedom. The lowest of a curve
is lowest by chance as well, so that all pairs of times are allowed for (Bonferroni).

Source  NIST SP 1065, 5.3: intervals by chi-square.
"""

from __future__ import annotations

import numpy as np
from scipy.special import fdtrc

from calibrations.noise_analysis.octaves import Curve

CHANCE = 0.05  # of a minimum where the deviation is level


def minimum_s(curve: Curve) -> float | None:
    """The averaging time, s, of the lowest deviation, where some longer one is higher by more than chance."""
    at = int(np.argmin(curve.deviation))
    longer = curve.tau_s > curve.tau_s[at]
    ratio = (curve.deviation[longer] / curve.deviation[at]) ** 2
    chance = fdtrc(curve.edf[longer], curve.edf[at], ratio)
    pairs = len(curve.tau_s) * (len(curve.tau_s) - 1) / 2
    return float(curve.tau_s[at]) if np.any(pairs * chance < CHANCE) else None
