"""Control charts of single results in the order of their runs: a jump by Shewhart's chart, slow drift by an EWMA.

    centre, sigma    mean of the baseline, and mean moving range / d2: the first runs, when all was well
    individuals      x_i beyond centre +- 3 sigma
    EWMA             z_i = lambda x_i + (1 - lambda) z_(i-1), z_0 = centre,
                     beyond centre +- L sigma sqrt(lambda / (2 - lambda) (1 - (1 - lambda)^(2 i)))

False alarms, runs on average until one: 370 of the individuals, 500 of the EWMA, 236 of both together, where centre and
sigma are known. From a baseline of 20 runs they are not well known: half of the charts in control signal within 80 runs
(165 if known). Run rules (Western Electric) are left out: four of them bring 370 down to 92, and the EWMA finds what
they find. Moving ranges are shown beside their limit, and judge nothing: they know nothing that the individuals do not.

Source  ISO 7870-2 (individuals, moving range), ISO 7870-6 (EWMA); lambda and L: Lucas and Saccucci, Technometrics 32,
        1990; run rules: Champ and Woodall, Technometrics 29, 1987; ranges: Rigdon, Cruthis and Champ, JQT 26, 1994.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from scipy.signal import lfilter

from calibrations.errors import TooFewRows
from calibrations.table import Array

D2 = 2 / sqrt(pi)  # mean range of two normal numbers, in sigma
D3 = sqrt(2 - 4 / pi)  # its standard deviation
D4 = 1 + 3 * D3 / D2  # upper limit of a moving range, in mean ranges
K = 3.0
LAMBDA, L = 0.2, 2.962
BASELINE = 20
FEWEST = 2


@dataclass(frozen=True)
class Chart:
    """One quantity over n runs. Arrays have shape (n,), `ranges` (n - 1,); limits are centre +- reach.

    `judged` is the number of the first run that the baseline does not hold, n where the baseline is not complete yet.
    """

    values: Array
    judged: int
    centre: float
    sigma: float
    ranges: Array
    range_limit: float
    ewma: Array
    ewma_reach: Array

    @property
    def reach(self) -> float:
        """Of the individuals."""
        return K * self.sigma

    @property
    def jumps(self) -> list[int]:
        """Numbers of the runs that are beyond the individuals' limits."""
        return np.flatnonzero(np.abs(self.values - self.centre) > self.reach).tolist()

    @property
    def drifts(self) -> list[int]:
        """Numbers of the runs at which the EWMA is beyond its limits."""
        return np.flatnonzero(np.abs(self.ewma - self.centre) > self.ewma_reach).tolist()

    @property
    def signals(self) -> list[int]:
        """Numbers of the runs after the baseline that are beyond a limit."""
        return sorted(k for k in {*self.jumps, *self.drifts} if k >= self.judged)

    @property
    def verdict(self) -> str:
        """`in control` or `out of control` by all runs after the baseline; `baseline` while there is none to judge."""
        if self.judged >= len(self.values):
            return "baseline"
        return "out of control" if self.signals else "in control"


def control_chart(values: Sequence[float], baseline: int = BASELINE, least_sigma: float = 0.0) -> Chart:
    """The chart of `values` in the order of their runs; its limits come from the first `baseline` of them.

    `least_sigma` is what each value is uncertain by itself: runs that happen to agree better tell nothing. Raises
    TooFewRows for less than two values.
    """
    x = np.asarray(values, dtype=np.float64)
    first = x[:baseline]
    if len(first) < FEWEST:
        raise TooFewRows(f"a control chart needs {FEWEST} runs at least, there are {len(first)}; run check-standard")
    centre, mean_range = float(first.mean()), float(np.abs(np.diff(first)).mean())
    sigma = max(mean_range / D2, least_sigma)
    faded = (1 - LAMBDA) ** (2 * np.arange(1, len(x) + 1))
    return Chart(
        values=x,
        judged=baseline,
        centre=centre,
        sigma=sigma,
        ranges=np.abs(np.diff(x)),
        range_limit=D4 * D2 * sigma,
        ewma=centre + lfilter([LAMBDA], [1, LAMBDA - 1], x - centre),
        ewma_reach=L * sigma * np.sqrt(LAMBDA / (2 - LAMBDA) * (1 - faded)),
    )
