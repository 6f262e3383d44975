"""The approach to steady state: found with true standard errors, and not where there is none.

SEEDS soaks of each kind, three times as many for standard errors. Of a hundred each, z of the time constant had an
rms of 0.89 beside white noise, 1.00 beside one slow process and 1.11 beside flicker.
"""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.analyses.soak import SteadyState, fit_steady_state
from calibrations.errors import TooFewRows
from tests.calibrations.soaks import WHITE_V, noise, times_s
from tests.slow import first_fast

SEEDS = 20
TAU_S, FAST_S, DRIFT_V = 5400.0, 240.0, 2.2e-3


def found(seed: int, kind: str, n: int = 52, *, slow_v: float = DRIFT_V, fast_v: float = 0.0) -> SteadyState:
    t_s = times_s(n)
    values = 2.5 - slow_v * np.exp(-t_s / TAU_S) + fast_v * np.exp(-t_s / FAST_S) + noise(seed, t_s, kind)
    return fit_steady_state(t_s, values, np.full(n, WHITE_V))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["flicker", "white", "slow"])
def test_time_constants_come_with_true_standard_errors(kind: str) -> None:
    states = [found(seed, kind) for seed in range(3 * SEEDS)]
    assert all(len(state.terms) == 1 for state in states)
    taus = np.array([state.terms[0].tau_s for state in states])
    assert 0.8 < np.sqrt(np.mean(((taus[:, 0] - TAU_S) / taus[:, 1]) ** 2)) < 1.25
    assert taus[:, 0].mean() == pytest.approx(TAU_S, rel=0.05)
    times = np.array([state.time_s or (np.nan, np.nan) for state in states])
    true = TAU_S * np.log(DRIFT_V / np.array([state.tolerance for state in states]))
    assert np.sqrt(np.nanmean(((times[:, 0] - true) / times[:, 1]) ** 2)) < 1.2
    assert np.isfinite(times).mean() > 0.9


@pytest.mark.parametrize("kind", first_fast(["slow", "white", "flicker"]))
def test_where_nothing_drifts_no_drift_is_claimed(kind: str) -> None:
    states = [found(seed, kind, slow_v=0.0) for seed in range(SEEDS)]
    assert sum(bool(state.terms) for state in states) == 0
    assert all(state.drift[0] == 0 < state.drift[1] for state in states)
    steady = [state.time_s for state in states if state.time_s]
    assert len(steady) > 0.9 * SEEDS
    assert all(time == (45.0, pytest.approx(45 / np.sqrt(12))) for time in steady)


@pytest.mark.parametrize("n", first_fast([20, 52]))
def test_a_random_walk_is_seldom_an_exponential_and_comes_to_no_rest(n: int) -> None:
    states = [found(seed, "walk", n, slow_v=0.0) for seed in range(SEEDS)]
    assert sum(bool(state.terms) for state in states) <= 0.1 * SEEDS
    assert sum(state.time_s is None for state in states) > 0.4 * SEEDS


@pytest.mark.parametrize("n", first_fast([20, 52]))
def test_minutes_are_told_from_hours(n: int) -> None:
    states = [found(seed, "white", n, fast_v=0.8e-3) for seed in range(SEEDS)]
    assert all(len(state.terms) == 2 for state in states)
    for k, tau_s in enumerate((TAU_S, FAST_S)):
        taus = np.array([state.terms[k].tau_s for state in states])
        assert np.sqrt(np.mean(((taus[:, 0] - tau_s) / taus[:, 1]) ** 2)) < 1.35


def test_a_drift_that_outlasts_the_record_reaches_no_steady_state() -> None:
    for seed in range(5):
        state = found(seed, "white", n=13)
        assert state.terms
        assert state.time_s is None
        assert state.drift[0] == pytest.approx(
            DRIFT_V * (np.exp(-45 / TAU_S) - np.exp(-times_s(13)[-1] / TAU_S)), abs=4 * state.drift[1]
        )


def test_a_straight_drift_is_no_steady_state_either() -> None:
    t_s = times_s(40)
    state = fit_steady_state(t_s, 2.5 + 1e-7 * t_s + noise(1, t_s, "white"), np.full(40, WHITE_V))
    assert state.time_s is None
    assert state.drift[0] == pytest.approx(1e-7 * np.ptp(t_s), rel=0.05)


def test_unit_and_zero_of_the_values_do_not_matter() -> None:
    t_s = times_s(30)
    values = 2.5 - DRIFT_V * np.exp(-t_s / TAU_S) + noise(3, t_s, "slow")
    plain, scaled = (
        fit_steady_state(t_s, values, np.full(30, WHITE_V)),
        fit_steady_state(t_s, 1e3 * values - 7, np.full(30, 1e3 * WHITE_V)),
    )
    assert plain.time_s is not None
    assert scaled.time_s == pytest.approx(plain.time_s, rel=1e-6)
    assert scaled.tolerance == pytest.approx(1e3 * plain.tolerance, rel=1e-6)


def test_without_known_white_noise_it_is_found_too() -> None:
    t_s = times_s(40)
    state = fit_steady_state(t_s, 28 - 6 * np.exp(-t_s / TAU_S) + noise(1, t_s, "white"), np.zeros(40))
    assert state.terms[0].tau_s[0] == pytest.approx(TAU_S, rel=1e-3)


def test_a_steady_state_of_few_values_is_refused() -> None:
    with pytest.raises(TooFewRows, match="at least 8"):
        found(1, "white", n=7)
