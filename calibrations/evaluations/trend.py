"""A straight line through repeated measurements: the drift of a reference pose."""

from __future__ import annotations

import numpy as np

from calibrations.errors import TooFewRows
from calibrations.table import Array

FEWEST = 3  # measurements that tell a trend from scatter


def trend(times: Array, values: Array) -> tuple[float, float]:
    """(slope, its standard error from the scatter about the line), shape (n,) each. Raises TooFewRows."""
    if len(times) < FEWEST:
        raise TooFewRows(f"{len(times)} measurements have no trend; at least {FEWEST} are needed")
    away = times - times.mean()
    slope = float(away @ values / (away @ away))
    left = values - values.mean() - slope * away
    return slope, float(np.sqrt(left @ left / (len(times) - 2) / (away @ away)))
