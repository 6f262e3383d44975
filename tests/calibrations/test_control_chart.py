"""Control charts against published numbers: constants, run lengths, a textbook's example; and counted over seeds."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from scipy.stats import norm

from calibrations.analyses.control_chart import D2, D4, EWMA_WEIGHT, Chart, control_chart
from calibrations.criteria import EWMA_LIMIT, LIMIT_SIGMAS
from calibrations.errors import TooFewRows

# NIST/SEMATECH e-Handbook 6.3.2.2, flow rates of ten batches
FLOWRATE = (49.6, 47.6, 49.9, 51.3, 47.8, 51.2, 52.6, 52.4, 53.6, 52.1)


def test_the_constants_are_the_tables() -> None:
    assert round(D2, 3) == 1.128
    assert round(D4, 3) == 3.267


def test_the_run_lengths_are_the_published_ones() -> None:
    assert 1 / (2 * norm.sf(LIMIT_SIGMAS)) == pytest.approx(370.4, abs=0.05)
    reach = EWMA_LIMIT * np.sqrt(
        EWMA_WEIGHT / (2 - EWMA_WEIGHT)
    )  # of the EWMA: Crowder's integral equation, Technometrics 29, 1987
    nodes, weights = leggauss(40)
    z, w = nodes * reach, weights * reach
    steps = norm.pdf((z[None, :] - (1 - EWMA_WEIGHT) * z[:, None]) / EWMA_WEIGHT) / EWMA_WEIGHT * w
    lengths = np.linalg.solve(np.eye(40) - steps, np.ones(40))
    assert 1 + w @ (norm.pdf(z / EWMA_WEIGHT) / EWMA_WEIGHT * lengths) == pytest.approx(500, abs=1)


def test_the_individuals_of_a_textbook() -> None:
    chart = control_chart(FLOWRATE, baseline=10)
    assert chart.centre == pytest.approx(50.81)
    assert chart.ranges.mean() == pytest.approx(1.8778, abs=1e-4)
    assert (chart.centre + chart.reach, chart.centre - chart.reach) == pytest.approx((55.8041, 45.8159), abs=3e-3)
    assert chart.range_limit == pytest.approx(3.267 * 1.8778, abs=1e-3)
    assert (chart.verdict, chart.jumps) == ("baseline", [])


def test_the_ewma_follows_its_recursion() -> None:
    chart = control_chart(FLOWRATE, baseline=4)
    z, expected = chart.centre, []
    for value in FLOWRATE:
        z = EWMA_WEIGHT * value + (1 - EWMA_WEIGHT) * z
        expected.append(z)
    np.testing.assert_allclose(chart.ewma, expected)
    assert chart.ewma_reach[0] == pytest.approx(EWMA_LIMIT * EWMA_WEIGHT * chart.sigma)
    assert chart.ewma_reach[-1] == pytest.approx(EWMA_LIMIT * chart.sigma * np.sqrt(1 / 9), rel=0.01)


def runs_until_a_signal(baseline: int, changed: np.ndarray, charts: int = 400) -> np.ndarray:
    """For each of `charts` seeds, how many runs after the baseline the first signal comes; nan for none."""
    found = np.full(charts, np.nan)
    for seed in range(charts):
        noise = np.random.default_rng(seed).standard_normal(baseline + len(changed))
        chart = control_chart(noise + np.append(np.zeros(baseline), changed), baseline)
        after = [k for k in sorted(chart.jumps + chart.drifts) if k >= baseline]
        found[seed] = after[0] - baseline + 1 if after else np.nan
    return found


def test_false_alarms_are_as_often_as_it_says() -> None:
    short = runs_until_a_signal(20, np.zeros(500))
    assert np.median(np.nan_to_num(short, nan=500)) == pytest.approx(80, rel=0.25)
    long = runs_until_a_signal(2000, np.zeros(1000))  # limits as good as known
    signals, runs = np.isfinite(long).sum(), np.nan_to_num(long, nan=1000).sum()
    assert runs / signals == pytest.approx(236, rel=0.2)


def test_drift_is_found_by_the_ewma_and_a_jump_by_either() -> None:
    assert np.nanmedian(runs_until_a_signal(20, np.ones(200))) < 15  # a step of one sigma
    assert np.nanmedian(runs_until_a_signal(20, np.full(50, 4.0))) == 1
    slow = control_chart(np.append(np.tile([0.0, 1.0], 10), 0.5 + 0.12 * np.arange(12)), 20)
    assert slow.drifts[0] < (slow.jumps or [32])[0]
    assert slow.verdict == "out of control"


def chart(values: list[float], **settings: float) -> Chart:
    return control_chart(values, baseline=4, **settings)


def test_only_runs_after_the_baseline_are_judged() -> None:
    wild = [0.0, 0.1, 0.0, 9.0]
    assert chart(wild).verdict == "baseline"
    assert chart([0.0, 0.1, 0.0, 0.1, 0.05]).verdict == "in control"
    assert chart([0.0, 0.1, 0.0, 0.1, 0.7]).verdict == "out of control"
    assert chart([0.0, 0.1, 0.0, 0.1, 0.7, 0.05]).verdict == "out of control"  # until a new baseline is begun


def test_runs_that_agree_better_than_their_noise_set_no_narrower_limits() -> None:
    same = [1.0, 1.0, 1.0, 1.0, 1.0 + 1e-15]
    assert chart(same).verdict == "out of control"
    assert chart(same, least_sigma=1e-6).verdict == "in control"


def test_a_chart_of_one_run_is_refused(golden) -> None:
    with golden.refused(TooFewRows):
        control_chart([1.0])
