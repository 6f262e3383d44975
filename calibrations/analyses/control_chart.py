"""Control charts of single results in the order of runs: Shewhart's chart for a jump, an EWMA for slow drift.

    centre, sigma    mean of the baseline runs, and mean moving range / d2
    individuals      x_i beyond centre +- 3 sigma
    EWMA             z_i = lambda x_i + (1 - lambda) z_(i-1), z_0 = centre,
                     beyond centre +- L sigma sqrt(lambda / (2 - lambda) (1 - (1 - lambda)^(2 i)))

Mean number of runs to a false alarm with known centre and sigma: 370 for individuals, 500 for the EWMA, 236 for both.
A baseline of 20 runs leaves them uncertain: half of the charts in control signal within 80 runs (165 if known). Run
rules (Western Electric) are not used: four of them reduce 370 to 92, and the EWMA detects the same. Moving ranges are
shown with their limit but give no signal, as they add nothing to the individuals.

Source  ISO 7870-2 (individuals, moving range), ISO 7870-6 (EWMA); lambda and L: Lucas and Saccucci, Technometrics 32,
        1990; run rules: Champ and Woodall, Technometrics 29, 1987; ranges: Rigdon, Cruthis and Champ, JQT 26, 1994.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from scipy.signal import lfilter

from calibrations.criteria import BASELINE_RUNS, EWMA_LIMIT, FEWEST_RUNS, LIMIT_SIGMAS
from calibrations.errors import TooFewRows
from calibrations.table import Array

D2 = 2 / sqrt(pi)  # mean range of two normal numbers, in sigma
D3 = sqrt(2 - 4 / pi)  # its standard deviation
D4 = 1 + 3 * D3 / D2  # upper limit of a moving range, in mean ranges
EWMA_WEIGHT = 0.2


@dataclass(frozen=True)
class Chart:
    """One quantity over n runs. Arrays have shape (n,), `ranges` (n - 1,); limits are centre +- reach.

    `judged` is the number of baseline runs, and so the number of the first run that is judged; at least n while the
    baseline is incomplete.
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
        """Half the distance of the individuals' limits."""
        return LIMIT_SIGMAS * self.sigma

    @property
    def jumps(self) -> list[int]:
        """Numbers of the runs beyond the individuals' limits."""
        return np.flatnonzero(np.abs(self.values - self.centre) > self.reach).tolist()

    @property
    def drifts(self) -> list[int]:
        """Numbers of the runs with the EWMA beyond its limits."""
        return np.flatnonzero(np.abs(self.ewma - self.centre) > self.ewma_reach).tolist()

    @property
    def signals(self) -> list[int]:
        """Numbers of the runs after the baseline beyond a limit."""
        return sorted(k for k in {*self.jumps, *self.drifts} if k >= self.judged)

    @property
    def verdict(self) -> str:
        """`in control` or `out of control` by the runs after the baseline; `baseline` while there are none."""
        if self.judged >= len(self.values):
            return "baseline"
        return "out of control" if self.signals else "in control"


def control_chart(values: Sequence[float], baseline: int = BASELINE_RUNS, least_sigma: float = 0.0) -> Chart:
    """The chart of `values` in the order of runs; the first `baseline` of them set its limits.

    `least_sigma` is the standard uncertainty of one value: sigma is at least this. Raises TooFewRows for fewer than
    FEWEST_RUNS.
    """
    x = np.asarray(values, dtype=np.float64)
    first = x[:baseline]
    if len(first) < FEWEST_RUNS:
        raise TooFewRows(
            f"a control chart needs at least {FEWEST_RUNS} runs; there are {len(first)}; run check-standard again"
        )
    centre, mean_range = float(first.mean()), float(np.abs(np.diff(first)).mean())
    if mean_range == 0:
        centre = float(first[0])  # without the rounding of the mean, which would be outside limits without a width
    sigma = max(mean_range / D2, least_sigma)
    faded = (1 - EWMA_WEIGHT) ** (2 * np.arange(1, len(x) + 1))
    return Chart(
        values=x,
        judged=baseline,
        centre=centre,
        sigma=sigma,
        ranges=np.abs(np.diff(x)),
        range_limit=D4 * D2 * sigma,
        ewma=centre + lfilter([EWMA_WEIGHT], [1, EWMA_WEIGHT - 1], x - centre),
        ewma_reach=EWMA_LIMIT * sigma * np.sqrt(EWMA_WEIGHT / (2 - EWMA_WEIGHT) * (1 - faded)),
    )
