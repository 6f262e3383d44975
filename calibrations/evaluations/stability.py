"""A quantity over a sensor's calibrations: its drift, what it scatters by from one to the next, and when it is due.

    y_i = a + b (t_i - t0) + e_i        var e_i = u_i^2 + s^2

u_i is what a calibration is uncertain by itself; s, what calibrations scatter by beyond that, is such that the weighted
squares come to their degrees of freedom n - 2 (Mandel and Paule). A later value is the line's, with the uncertainty of
the line and s. It is due when its 95 % interval (Student, n - 2) first reaches beyond what is allowed.

Source  Mandel and Paule, Anal. Chem. 42 (1970); ILAC-G24 / OIML D 10 (intervals by drift); JCGM 100, H.3 (a line).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import stdtrit

from calibrations.errors import TooFewRows
from calibrations.table import Array

FEWEST = 3
LEVEL = 0.95
FURTHEST_DAYS = 3653  # ten years: beyond, nothing is said
YEAR_DAYS = 365.25


@dataclass(frozen=True)
class Stability:
    """The line through n calibrations: `slope` per day, `scatter` s; `covariance` of (value at t0, slope)."""

    t_days: Array
    values: Array
    stds: Array
    middle_days: float
    centre: float
    slope: float
    scatter: float
    covariance: Array

    @property
    def coverage(self) -> float:
        """Student's factor for 95 %."""
        return float(stdtrit(len(self.values) - 2, (1 + LEVEL) / 2))

    @property
    def slope_std(self) -> float:
        """Standard uncertainty of the slope, per day."""
        return float(np.sqrt(self.covariance[1, 1]))

    @property
    def drifts(self) -> bool:
        """Whether the slope is more than its expanded uncertainty."""
        return abs(self.slope) > self.coverage * self.slope_std

    def predict(self, t_days: Array) -> tuple[Array, Array]:
        """Value and standard uncertainty at other times, shape as `t_days`."""
        since = np.asarray(t_days, dtype=np.float64) - self.middle_days
        C = self.covariance
        variance = C[0, 0] + 2 * since * C[0, 1] + since**2 * C[1, 1] + self.scatter**2
        return np.asarray(self.centre + self.slope * since), np.asarray(np.sqrt(variance))

    def due_days(self, low: float, high: float) -> float | None:
        """The first day since the last calibration on which the interval reaches beyond; None within ten years."""
        days = self.t_days[-1] + np.arange(FURTHEST_DAYS + 1.0)
        value, std = self.predict(days)
        beyond = (value - self.coverage * std < low) | (value + self.coverage * std > high)
        return float(days[np.argmax(beyond)]) if beyond.any() else None


def stability(t_days: Sequence[float], values: Sequence[float], stds: Sequence[float]) -> Stability:
    """The line through calibrations in the order of time, each with its standard uncertainty, above 0.

    Raises TooFewRows for less than three, or where all are of one day.
    """
    t, y, u = (np.asarray(each, dtype=np.float64) for each in (t_days, values, stds))
    if len(t) < FEWEST or not np.ptp(t) > 0:
        raise TooFewRows(f"a drift shows in {FEWEST} calibrations at different times at least; there are {len(t)}")
    scatter = _scatter(t, y, u)
    middle = float(np.average(t, weights=1 / (u**2 + scatter**2)))
    theta, covariance, _ = _line(t - middle, y, u, scatter)
    return Stability(t, y, u, middle, float(theta[0]), float(theta[1]), scatter, covariance)


def _line(t: Array, y: Array, u: Array, scatter: float) -> tuple[Array, Array, float]:
    """Weighted least squares: (value at 0, slope), covariance, and the weighted sum of squares."""
    w = 1 / (u**2 + scatter**2)
    X = np.column_stack([np.ones_like(t), t])
    covariance = np.asarray(np.linalg.inv((X.T * w) @ X))
    theta = covariance @ (X.T @ (w * y))
    return theta, covariance, float(np.sum(w * (y - X @ theta) ** 2))


def _scatter(t: Array, y: Array, u: Array) -> float:
    """s, at which the weighted squares are as many as the degrees of freedom; 0 where they are fewer without it."""
    centred, freedom = t - t.mean(), len(t) - 2

    def excess(s: float) -> float:
        return _line(centred, y, u, s)[2] - freedom

    if excess(0.0) <= 0:
        return 0.0
    return float(brentq(excess, 0.0, 10 * float(np.ptp(y)) + float(u.max())))
