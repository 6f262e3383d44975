"""Stability of a quantity: agreement of two calibrations, repeatability, drift over calibrations, trend of one pose.

Agreement: two values with expanded uncertainties U agree if |E_n| <= 1.

    E_n = (a - b) / sqrt(U_a^2 + U_b^2)

Repeatability: the change of a quantity between repetitions beyond the noise of each.

    s_b^2 = s^2 - u^2      s^2: variance of n repetitions, u^2: mean square of their own standard errors

s^2 of n repetitions has n - 1 degrees of freedom: its relative standard deviation is sqrt(2 / (n - 1)). This applies to
the sum of both variances, which is at least u^2: repetitions that agree by chance do not lower it.

Drift: the line through a sensor's calibrations, their scatter about it, and the next due date.

    y_i = a + b (t_i - t0) + e_i        var e_i = u_i^2 + s^2

u_i is the standard uncertainty of a calibration. s is the further scatter between calibrations: the weighted sum of
squares then equals its n - 2 degrees of freedom. A prediction lies on the line, with the uncertainty of the line and s.
A calibration is due when the 95 % interval (Student, n - 2) first exceeds a limit.

Trend: a straight line through repeated measurements of a reference pose.

Source  ISO/IEC 17043:2023 and ISO 13528:2022, 9.7 (E_n); ISO 5725-2, variance between; JCGM 100, 4.2, H.3 (a line);
        Mandel and Paule, Anal. Chem. 42 (1970); ILAC-G24 / OIML D 10 (intervals by drift).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from calibrations.criteria import COVERAGE, COVERAGE_FACTOR, FEWEST_FOR_DRIFT, HORIZON_DAYS
from calibrations.errors import DataError, TooFewRows
from calibrations.estimators.least_squares import between_variance, least_squares
from calibrations.table import Array

YEAR_DAYS = 365.25


@dataclass(frozen=True)
class Agreement:
    """Difference a - b, its expanded uncertainty (k = 2), and E_n."""

    a: float
    b: float
    difference: float
    expanded: float

    @property
    def e_n(self) -> float:
        return self.difference / self.expanded if self.expanded > 0 else 0.0

    @property
    def agrees(self) -> bool:
        return abs(self.e_n) <= 1


def compare_values(a: tuple[float, float], b: tuple[float, float]) -> Agreement:
    """Compare two values with standard uncertainties, taken as independent."""
    return Agreement(a[0], b[0], a[0] - b[0], COVERAGE_FACTOR * (a[1] ** 2 + b[1] ** 2) ** 0.5)


def repeatability(values: Sequence[float], stds: Sequence[float]) -> tuple[float, float | None]:
    """(s_b, its standard error) of `values` with own standard errors `stds`; 0 where noise explains the scatter.

    The standard error is the distance to the root of s_b^2 plus its standard deviation, so it holds for s_b = 0 too. It
    is None, not determined, where all values are equal and their own standard errors are 0. Raises DataError for fewer
    than two values.
    """
    n = len(values)
    if n < 2:
        raise DataError("repeatability needs at least two repetitions; resume the run")
    variance = float(np.var(values, ddof=1))
    noise = float(np.mean(np.square(stds)))
    between_variance = max(0.0, variance - noise)
    spread = max(variance, noise) * np.sqrt(2 / (n - 1))
    std = float(np.sqrt(between_variance + spread) - np.sqrt(between_variance))
    return float(np.sqrt(between_variance)), std if std > 0 else None


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
        return float(stdtrit(len(self.values) - 2, (1 + COVERAGE) / 2))

    @property
    def slope_std(self) -> float:
        """Standard uncertainty of the slope, per day."""
        return float(np.sqrt(self.covariance[1, 1]))

    @property
    def drifts(self) -> bool:
        """Whether the slope exceeds its expanded uncertainty."""
        return abs(self.slope) > self.coverage * self.slope_std

    def predict(self, t_days: Array) -> tuple[Array, Array]:
        """Value and standard uncertainty at other times, shape as `t_days`."""
        elapsed_days = np.asarray(t_days, dtype=np.float64) - self.middle_days
        C = self.covariance
        variance = C[0, 0] + 2 * elapsed_days * C[0, 1] + elapsed_days**2 * C[1, 1] + self.scatter**2
        return np.asarray(self.centre + self.slope * elapsed_days), np.asarray(np.sqrt(variance))

    def due_days(self, low: float, high: float) -> float | None:
        """The first day since the last calibration with the interval beyond the limits; None within ten years."""
        days = self.t_days[-1] + np.arange(HORIZON_DAYS + 1.0)
        value, std = self.predict(days)
        outside = (value - self.coverage * std < low) | (value + self.coverage * std > high)
        return float(days[np.argmax(outside)]) if outside.any() else None


def fit_stability(t_days: Sequence[float], values: Sequence[float], stds: Sequence[float]) -> Stability:
    """The line through calibrations in order of time, each with a standard uncertainty above 0.

    Raises TooFewRows for fewer than three, or for calibrations of one day only.
    """
    t, y, u = (np.asarray(series, dtype=np.float64) for series in (t_days, values, stds))
    if len(t) < FEWEST_FOR_DRIFT:
        raise TooFewRows(f"a drift needs at least {FEWEST_FOR_DRIFT} calibrations; there are {len(t)}")
    if not np.ptp(t) > 0:
        raise TooFewRows(f"a drift needs calibrations of different times; all {len(t)} have the same time")
    scatter = float(np.sqrt(between_variance(_line(t - t.mean()), y, u**2, len(t) - 2)))
    variances = u**2 + scatter**2
    middle = float(np.average(t, weights=1 / variances))
    line = least_squares(_line(t - middle), y, variances)
    return Stability(t, y, u, middle, float(line.values[0]), float(line.values[1]), scatter, line.covariance)


def _line(t: Array) -> Array:
    """Columns of a straight line over times (n,): value at 0 and slope."""
    return np.column_stack([np.ones_like(t), t])


def fit_trend(times: Array, values: Array) -> tuple[float, float]:
    """(slope, its standard error from the scatter about the line), shape (n,) each. Raises TooFewRows."""
    if len(times) < FEWEST_FOR_DRIFT:
        raise TooFewRows(f"a trend needs at least {FEWEST_FOR_DRIFT} measurements; there are {len(times)}")
    line = least_squares(_line(times - times.mean()), values)
    return float(line.values[1]), float(line.scattered[1])
