"""The white noise of a mean of correlated samples, against simulated ones."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from calibrations.mean_noise import inflation, norm_std, white_std
from calibrations.table import Table

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
    assert white_std(Table.from_columns("poses", {**POSE, "vx_std_v": [1.0, 0.0]})) is None
    both = {**POSE, "vy_v": [1.0, 1.0], "vx_std_v": [1.0, 1.0]}
    assert white_std(Table.from_columns("poses", both)) is None


def test_magnitude_takes_the_noise_along_itself() -> None:
    columns = {"ax": [2.0, 0.0, 1.0, 1.0], "ay": [1.0, 1.0, 2.0, 0.0], "az": [1.0, 1.0, 1.0, 1.0], "n": [100.0] * 4}
    std = np.tile([1.0, 2.0, 3.0], (4, 1))
    table = Table.from_columns("positions", columns)
    np.testing.assert_allclose(norm_std(table, std)[:, 0], [1.0, 1.0, 2.0, 2.0])
    own = Table.from_columns("positions", {**columns, "norm_std": [5.0] * 4})
    np.testing.assert_allclose(norm_std(own, std)[:, 0], 0.5)
