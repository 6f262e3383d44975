"""How far apart two explanations will lie in data that nobody has measured yet: T-optimality.

    lambda = min over theta of |W (f_best - f_rival(theta))|^2        W makes the noise white

It is the noncentrality of the test between them. Where the best is right, twice the logarithm of the likelihood ratio
scatters about lambda with the standard deviation 2 sqrt(lambda); sqrt(lambda) is their distance in standard deviations.

Source  Atkinson and Fedorov, Biometrika 62 (1975), 57-70; Dette, Melas and Guchenko, Annals of Statistics 43 (2015),
        1959-1985.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.special import ndtr

from calibrations.design.information import noise_on
from calibrations.fit import Fit
from calibrations.joined import joined
from calibrations.problem import Problem
from calibrations.search.candidates import NOT_TOLD_APART
from calibrations.table import Array, Table

CERTAIN = 0.95  # probability of telling two explanations apart with which an experiment is worth its time
NAMED = 20.0  # a gain of two parameters that has a chance of 0.003 on noise, in a search worth some 60 trials
ROUNDS, CLOSE = 12, 1e-2  # evaluations, and the relative change of lambda at which they end


@dataclass(frozen=True)
class Expected:
    """What an experiment will bring: lambda of its own data, and of all data together.

    `visible` is lambda of its own data between an explanation and nothing missing: what does not show is not named.
    """

    alone: float
    together: float
    visible: float = np.inf

    @property
    def deviations(self) -> float:
        """How many standard deviations the explanations will lie apart, all data together."""
        return float(np.sqrt(self.together))

    @property
    def probability(self) -> float:
        """Of telling them apart, all data together."""
        return told_apart(self.together)

    @property
    def probability_alone(self) -> float:
        """Of finding that something is missing, and telling what, by its own data."""
        return min(told_apart(self.alone), _beyond(self.visible, NAMED))


def expected(best: Fit, rival: Fit, table: Table) -> Expected:
    """What the foreseen `table` will tell of two explanations of the data at hand, whichever of them is right.

    Both are fits to the same data. Of the two cases, the best right and the rival right, the worse one counts. Times
    of `table` come after those of the data.
    """
    ways = [one_way(best, rival, table), one_way(rival, best, table)]
    return Expected(min(w.alone for w in ways), min(w.together for w in ways))


def told_apart(noncentrality: float) -> float:
    """Probability that the likelihood ratio will be beyond the odds at which two explanations are told apart."""
    return _beyond(noncentrality, NOT_TOLD_APART)


def _beyond(noncentrality: float, threshold: float) -> float:
    """Probability that a statistic of mean lambda and standard deviation 2 sqrt(lambda) is beyond a threshold."""
    if noncentrality <= 0 or noncentrality == np.inf:
        return float(noncentrality > 0)
    return float(ndtr((noncentrality - threshold) / (2 * np.sqrt(noncentrality))))


def one_way(right: Fit, wrong: Fit, table: Table) -> Expected:
    """As `expected`, where `right` is: predictions come from both fits' own history, the noise from that of `right`."""
    whole = joined([right.table, table])
    known, new = np.arange(whole.n) < right.table.n, np.arange(whole.n) >= right.table.n
    truth = Problem(whole, right.problem.layout).residual(right.theta)
    mistaken = Problem(whole, wrong.problem.layout)
    noise = noise_on(right.noise, Problem(table, right.problem.layout))

    def white(columns: Array) -> tuple[Array, Array]:
        """Rows of the data at hand, and of the new; both (channels, n, k) -> (rows, k)."""
        return right.noise.whiten(columns[:, known]), noise.whiten(columns[:, new])

    def least(parts: slice) -> float:
        def distance(theta: Array) -> Array:
            return np.concatenate(white((mistaken.residual(theta) - truth)[:, :, None])[parts])[:, 0]

        def slope(theta: Array) -> Array:
            return np.concatenate(white(mistaken.jacobian(theta))[parts])

        size, bounds = mistaken.layout.typical, mistaken.layout.bounds
        found = least_squares(distance, wrong.theta, slope, bounds, x_scale=size, ftol=CLOSE, max_nfev=ROUNDS)
        return 2 * float(found.cost)

    return Expected(least(slice(1, None)), least(slice(None)))
