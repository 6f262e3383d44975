"""Siblings: published posteriors, and intervals that hold what they say over many batches."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.fleet.siblings import Siblings, fit_siblings

# Rubin (1981), coaching in eight schools: effects and standard errors; Gelman et al., Bayesian Data Analysis, 5.5:
# quantiles of the posterior from 200 draws, so to a few points.
EFFECTS = np.array([28.0, 8.0, -3.0, 7.0, -1.0, 1.0, 18.0, 12.0])
ERRORS = np.array([15.0, 10.0, 16.0, 11.0, 9.0, 11.0, 10.0, 18.0])
LOW = np.array([-2, -5, -11, -7, -9, -7, -1, -6])
MEDIAN = np.array([10, 8, 7, 8, 5, 6, 10, 8])
HIGH = np.array([31, 23, 19, 21, 18, 28, 26, 33])


def test_eight_schools_as_in_the_book() -> None:
    found = fit_siblings(EFFECTS, ERRORS**2)
    low, high = found.interval()
    assert np.abs(found.interval(0.0)[0] - MEDIAN).max() < 2
    assert np.abs(low - LOW).max() < 3
    assert np.sort(np.abs(high - HIGH))[5] < 3  # of 200 draws five lie beyond: two of the book's ends are far out
    assert found.mean == pytest.approx(8, abs=0.5)
    assert not found.outliers.any()


# Efron and Morris, Stein's paradox in statistics (1977): 18 batters after 45 times at bat, and how the season ended.
FIRST = np.array([400, 378, 356, 333, 311, 311, 289, 267, 244, 244, 222, 222, 222, 222, 222, 200, 178, 156]) / 1000
SEASON = np.array([346, 298, 276, 222, 273, 270, 263, 210, 269, 230, 264, 256, 303, 264, 226, 285, 316, 200]) / 1000


def test_batting_averages_are_foretold_better_by_pooling() -> None:
    average = float(FIRST.mean())
    found = fit_siblings(FIRST, np.full(18, average * (1 - average) / 45))
    shrunk = 1 - np.polyfit(FIRST - average, found.values - average, 1)[0]
    assert 0.65 < shrunk < 0.9  # in the paper 0.788, with one estimate of tau
    alone, pooled = np.sum((FIRST - SEASON) ** 2), np.sum((found.values - SEASON) ** 2)
    assert alone == pytest.approx(0.077, abs=0.002)  # the paper's total squared errors: 0.077 and 0.022
    assert pooled == pytest.approx(0.022, abs=0.003)
    low, high = found.interval()
    assert np.mean((low <= SEASON) & (high >= SEASON)) > 0.85


@pytest.mark.parametrize("count", [5, 20, 100])
@pytest.mark.parametrize("tau", [0.0, 0.3, 1.0, 5.0])
def test_intervals_hold_what_they_say(count: int, tau: float) -> None:
    held = np.mean([_held(count, tau, seed)[0] for seed in range(1200 // count)])
    assert 0.92 < held <= (1.0 if tau < 1 else 0.98)  # where all are nearly equal they are too wide, never too short


@pytest.mark.parametrize("count", [5, 20])
def test_one_that_is_unlike_the_rest_pulls_nobody_and_is_not_pulled(count: int) -> None:
    tried = [_held(count, 0.5, seed, off=40.0) for seed in range(1200 // count)]
    assert 0.92 < np.mean([held for held, _ in tried]) < 0.99
    strange = [found for _, found in tried]
    assert all(found.values[0] == pytest.approx(found.y[0], abs=1.0) for found in strange)
    assert all(found.stds[1:].mean() < 1.15 * np.sqrt(found.v[1:].mean()) for found in strange)
    if count == 20:
        assert all(found.outliers[0] and found.outliers.sum() == 1 for found in strange)


def test_nobody_is_set_apart_where_all_are_alike() -> None:
    assert np.mean([_held(20, 1.0, seed)[1].outliers.any() for seed in range(200)]) < 0.03


def _held(count: int, tau: float, seed: int, off: float = 0.0) -> tuple[float, Siblings]:
    """Share of a batch's true values that their intervals hold, but for the first one where it is `off`."""
    rng = np.random.default_rng([5, count, int(10 * tau), seed])
    v = rng.uniform(0.5, 1.5, count) ** 2
    truth = 3 + tau * rng.standard_normal(count)
    truth[0] += off
    found = fit_siblings(truth + np.sqrt(v) * rng.standard_normal(count), v)
    low, high = found.interval()
    return float(np.mean(((low <= truth) & (high >= truth))[int(off > 0) :])), found


def test_two_teach_each_other_nothing() -> None:
    found = fit_siblings(np.array([1.0, 2.0]), np.array([0.1, 0.1]))
    assert not found.pooled
    assert list(found.values) == [1.0, 2.0]
