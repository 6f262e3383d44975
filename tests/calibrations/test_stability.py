"""Drift over calibrations: found, uncertain by as much as it scatters, and due when it may reach the limit."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.analyses.stability import compare_values, fit_stability
from calibrations.errors import TooFewRows
from calibrations.presentation.chart import Points
from calibrations.presentation.charts.history import Life, lives
from calibrations.presentation.interactive import figure
from calibrations.presentation.static import png

DAYS = np.arange(8) * 365.0


def drawn(seed: int, scatter: float = 2e-4, slope: float = 1e-6) -> tuple[np.ndarray, np.ndarray]:
    """Values of eight yearly calibrations, and their own uncertainties."""
    rng = np.random.default_rng(seed)
    stds = np.full(8, 5e-5)
    return 2.5 + slope * DAYS + np.hypot(scatter, 5e-5) * rng.standard_normal(8), stds


def test_the_slope_is_covered_as_often_as_it_is_said() -> None:
    inside = 0
    for seed in range(300):
        found = fit_stability(DAYS, *drawn(seed))
        inside += abs(found.slope - 1e-6) < found.coverage * found.slope_std
    assert 0.91 < inside / 300 < 0.99


def test_the_scatter_between_calibrations_is_found_and_none_where_there_is_none() -> None:
    squares = [fit_stability(DAYS, *drawn(seed)).scatter ** 2 for seed in range(200)]
    assert np.sqrt(np.mean(squares)) == pytest.approx(2e-4, rel=0.1)
    assert fit_stability(DAYS, 2.5 + 0 * DAYS, [1e-4] * 8).scatter == 0


def test_due_is_the_first_day_on_which_the_interval_reaches_the_limit() -> None:
    found = fit_stability(DAYS, 2.5 + 1e-6 * DAYS, [1e-6] * 8)
    due = found.due_days(2.4, 2.505)
    assert due is not None
    (before, _), (value, std) = (found.predict(np.array([day])) for day in (due - 1, due))
    assert value[0] + found.coverage * std[0] > 2.505
    assert before[0] < 2.505
    assert due == pytest.approx(5000, abs=15)  # 5 mV at 1 uV a day, sooner by the uncertainty
    assert found.due_days(2.4, 2.6) is None
    assert found.due_days(2.5024, 2.6) is None  # it goes up
    falling = fit_stability(DAYS, 2.5 - 1e-6 * DAYS, [1e-6] * 8)
    assert falling.due_days(2.495, 2.6) == due
    assert found.drifts


def test_it_is_due_at_once_where_it_is_beyond_already() -> None:
    found = fit_stability(DAYS, 2.5 + 1e-6 * DAYS, [1e-6] * 8)
    assert found.due_days(2.4, 2.501) == DAYS[-1]


def test_two_calibrations_tell_no_drift(golden) -> None:
    for days in ([0.0, 365.0], [5.0, 5.0, 5.0]):
        with golden.refused(TooFewRows):
            fit_stability(days, [1.0] * len(days), [0.1] * len(days))


def test_two_values_agree_by_the_e_n_number() -> None:
    found = compare_values((2.5, 3e-4), (2.501, 4e-4))
    assert (found.difference, found.expanded) == (pytest.approx(-1e-3), pytest.approx(1e-3))
    assert found.e_n == pytest.approx(-1.0)
    assert not compare_values((2.5, 1e-4), (2.501, 1e-4)).agrees


def test_the_history_of_a_sensor_is_drawn() -> None:
    values, stds = drawn(1)
    line = fit_stability(DAYS, values, stds)
    one = Life("bias-x", "V", DAYS.tolist(), values.tolist(), stds.tolist(), line, (2.49, 2.51), 4000.0, "due then")
    chart = lives([one, Life("bias-y", "V", [0.0], [2.5], [0.1])])
    assert [panel.title for (panel,) in chart.panels] == ["bias-x", "bias-y"]
    dots = next(series for series in chart.panels[0][0].series if isinstance(series, Points))
    assert dots.low is not None
    np.testing.assert_allclose(dots.y - dots.low, 2 * stds)
    assert png(chart).startswith(b"\x89PNG")
    assert "due then" in [note["text"] for note in figure(chart, "life")["layout"]["annotations"]]
