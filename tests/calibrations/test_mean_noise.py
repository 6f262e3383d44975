"""The white noise of a mean of correlated samples, against simulated ones."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from calibrations.means.noise import (
    inflation,
    measured_inflation,
    neighbour_std,
    neighbours_contradict,
    norm_std,
    white_std,
)
from calibrations.table import Array, Table

FILTER = {"filter_corner_hz": 15.07, "sample_rate_hz": 1000.0}
POSE = {"alpha_deg": [90.0, 90.0], "beta_deg": [0.0, 90.0], "vx_v": [3.5, 2.5], "n": [5000.0, 2500.0]}


def test_mean_of_first_order_low_passed_samples() -> None:
    rho = np.exp(-2 * np.pi * 15.07 / 1000)
    rng = np.random.default_rng(4)
    start = rng.standard_normal((1000, 1))
    samples, _ = lfilter([np.sqrt(1 - rho**2)], [1, -rho], rng.standard_normal((1000, 5000)), axis=1, zi=rho * start)
    table = Table.from_columns("poses", {**POSE, "vx_std_v": [1.0, 1.0]}, FILTER)
    said = white_std(table)
    assert said is not None
    assert samples.std() == pytest.approx(1.0, abs=0.01)
    assert samples.mean(axis=1).std() == pytest.approx(said[0, 0], rel=3 / np.sqrt(2000))
    assert said[1, 0] == pytest.approx(said[0, 0] * np.sqrt(2))


def test_without_a_filter_samples_are_independent() -> None:
    table = Table.from_columns("poses", {**POSE, "vx_std_v": [1.0, 1.0]})
    assert inflation(table) == 1.0
    np.testing.assert_allclose(white_std(table), [[5000**-0.5], [2500**-0.5]])


def test_not_known_without_count_or_spread() -> None:
    assert white_std(Table.from_columns("poses", POSE)) is None
    assert white_std(Table.from_columns("poses", {**POSE, "vx_std_v": [0.0, 0.0]})) is None
    both = {**POSE, "vy_v": [1.0, 1.0], "vx_std_v": [1.0, 1.0]}
    assert white_std(Table.from_columns("poses", both)) is None


def test_samples_on_one_code_have_the_noise_of_the_others() -> None:
    columns = {"alpha_deg": [90.0] * 3, "beta_deg": [0.0, 1.0, 2.0], "vx_v": [1.0] * 3, "n": [100.0] * 3}
    std = white_std(Table.from_columns("poses", {**columns, "vx_std_v": [2.0, 1e-16, 2.0]}))
    assert std is not None
    assert std[1, 0] == pytest.approx(std[0, 0])


def test_magnitude_takes_the_noise_along_itself() -> None:
    columns = {"ax": [2.0, 0.0, 1.0, 1.0], "ay": [1.0, 1.0, 2.0, 0.0], "az": [1.0, 1.0, 1.0, 1.0], "n": [100.0] * 4}
    std = np.tile([1.0, 2.0, 3.0], (4, 1))
    table = Table.from_columns("positions", columns)
    np.testing.assert_allclose(norm_std(table, std)[:, 0], [1.0, 1.0, 2.0, 2.0])
    own = Table.from_columns("positions", {**columns, "norm_std": [5.0] * 4})
    np.testing.assert_allclose(norm_std(own, std)[:, 0], 0.5)


def correlated(rho: float, blocks: int, n: int) -> Array:
    """Samples of two channels, each correlated by `rho` from one to the next."""
    steps = np.random.default_rng(11).standard_normal((blocks, n + 200, 2))
    return np.asarray(lfilter([1.0], [1.0, -rho], steps, axis=1)[:, 200:])


@pytest.mark.parametrize("rho", [0.91, 0.0, -0.3])
def test_the_inflation_of_samples_is_measured(rho: float) -> None:
    """Right to 2 % on average over many runs, and its standard error is that of one run."""
    true = (1 + rho) / (1 - rho)
    found = [measured_inflation(part) for part in np.split(correlated(rho, 1024, 2500), 16)]
    factors = np.array([factor for factor, _ in found]).ravel() / true
    said = np.mean([std for _, std in found]) / true
    assert factors.mean() == pytest.approx(1.0, abs=min(0.02, 4 * said / np.sqrt(32)))
    assert factors.std() == pytest.approx(said, rel=0.4)


def test_blocks_about_means_of_their_own() -> None:
    """What differs from pose to pose is no noise."""
    samples = correlated(0.5, 64, 1000) + np.linspace(0, 1000, 64)[:, None, None]
    factor, std = measured_inflation(samples)
    assert np.all(np.abs(factor - 3) < 4 * std)


def test_nothing_is_measured_without_noise_or_in_short_blocks() -> None:
    silent, short = np.ones((5, 100, 1)), correlated(0.99, 20, 200)
    for blocks in (silent, short, short[:, :1]):
        assert np.isnan(measured_inflation(blocks)[0]).all()


def test_a_measured_inflation_comes_before_the_filters() -> None:
    both = {**POSE, "vy_v": [1.0, 1.0], "vx_std_v": [1.0, 1.0], "vy_std_v": [1.0, 1.0]}
    table = Table.from_columns("poses", both, {**FILTER, "noise_inflation_x": 50.0})
    np.testing.assert_allclose(white_std(table)[0], [0.1, np.sqrt(inflation(table, "y") / 5000)])
    assert inflation(table, "y") == inflation(table) == pytest.approx(21.14, abs=0.01)


def test_rows_of_the_stated_noise_do_not_contradict_it() -> None:
    random = np.random.default_rng(5)
    for n in (3, 12, 100, 500):
        false_alarms = sum(neighbours_contradict(random.standard_normal((2, n))) for _ in range(500))
        assert false_alarms <= 500 * 0.01  # SIGNIFICANT of them, and more of short tables, whose rows are dependent
    assert not neighbours_contradict(np.zeros((2, 2)))


def test_rows_that_differ_by_less_contradict_the_noise_whatever_slow_error_they_have() -> None:
    random, t = np.random.default_rng(6), np.linspace(0.0, 1.0, 200)
    for level in (0.5, 0.8):
        rows = level * random.standard_normal((2, 200)) + np.sin(7 * t)
        assert np.sqrt(np.mean(rows**2)) > 0.8
        assert neighbours_contradict(rows)
        assert neighbour_std(rows) == pytest.approx([level, level], rel=0.2)
