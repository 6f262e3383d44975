"""How much a quantity changes from one repetition to the next, beyond the noise of each.

    s_b^2 = s^2 - u^2      s^2: variance of n repetitions, u^2: mean square of their own standard errors

Of few repetitions s^2 is known by chi-square with n - 1 degrees of freedom: its relative standard deviation is
sqrt(2 / (n - 1)).

Source  ISO 5725-2, variance between; JCGM 100, 4.2.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibrations.errors import DataError


def between(values: Sequence[float], stds: Sequence[float]) -> tuple[float, float]:
    """(s_b, its standard error) of `values` with own standard errors `stds`; 0 where noise explains all.

    The standard error is the way up to s_b^2 and one standard deviation: it holds where s_b is 0 too. Raises DataError
    for fewer than two.
    """
    n = len(values)
    if n < 2:
        raise DataError("repeatability needs two repetitions at least; resume the run")
    variance = float(np.var(values, ddof=1))
    left = max(0.0, variance - float(np.mean(np.square(stds))))
    spread = variance * np.sqrt(2 / (n - 1))
    return float(np.sqrt(left)), float(np.sqrt(left + spread) - np.sqrt(left))
