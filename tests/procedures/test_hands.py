"""A handful of simulated hands: hand-positions beside a stage and the prescriptions of other programs.

`python -m tests.benchmark.hands 100` has the figures of a hundred.
"""

from __future__ import annotations

import numpy as np
import pytest

from drivers.handheld.hand import Hand
from tests.benchmark.hands import compared
from tests.handling import by_imu_tk, by_procedure, magnitude_fit, on_stage, truth, world_of

HANDS = 4


def test_the_estimate_of_all_methods_is_exact_without_noise() -> None:
    true = truth(world_of(3))
    ups = np.random.default_rng(1).standard_normal((12, 3))
    ups /= np.linalg.norm(ups, axis=1, keepdims=True)
    lower = np.linalg.cholesky(true.M @ true.M.T)  # a turn of the sensor's frame has no effect
    b, M, residual = magnitude_fit(true.b + ups @ lower.T)
    assert b == pytest.approx(true.b, abs=1e-7)
    assert pytest.approx(lower, abs=1e-7) == M
    assert residual < 1e-8


def test_one_hand_reaches_a_fraction_of_the_target() -> None:
    found = by_procedure(1)
    errors = found.errors(truth(world_of(1)))
    assert np.abs(errors["bias_mg"]).max() < 1
    assert np.abs(errors["scale_per_mille"]).max() < 1
    assert np.abs(errors["angle_deg"]).max() < 0.06
    assert found.positions == 12


@pytest.mark.slow
def test_several_hands_are_compared_with_the_published_methods() -> None:
    found = compared(HANDS)
    ours, stage = found["hand-positions, 1 mg"], found["stage, 26 poses"]
    assert ours["failed"] == 0
    assert ours["positions"] <= 13
    assert ours["bias_mg_largest"] < 1
    for name in ("imu_tk, 16 positions", "imu_tk, 36 positions"):
        assert ours["time_s"] < found[name]["time_s"]
    assert ours["angle_deg"] < 0.2 * found["imucal"]["angle_deg"]
    assert stage["bias_mg"] < ours["bias_mg"] < 4 * stage["bias_mg"]
    finer = found["hand-positions, 0.1 mg"]
    assert finer["angle_deg"] < ours["angle_deg"]
    assert finer["angle_deg_largest"] < 0.03


@pytest.mark.slow
def test_a_clumsy_hand_takes_longer_and_is_not_worse() -> None:
    clumsy = Hand(slips=0.3, errs=0.15, clings=0.3, patience_s=5.0, table_deg=5.0, tremor_g=0.06)
    for seed in range(1, 5):
        found = by_procedure(seed, clumsy)
        assert np.abs(found.errors(truth(world_of(seed)))["bias_mg"]).max() < 1
        assert np.abs(found.errors(truth(world_of(seed)))["angle_deg"]).max() < 0.06
    calm = by_imu_tk(1, Hand(slips=0.0, errs=0.0, clings=0.0))
    assert calm is not None
    assert np.abs(calm.errors(truth(world_of(1)))["bias_mg"]).max() < 1


def test_a_calibration_on_a_stage_finds_the_true_values() -> None:
    errors = on_stage(1).errors(truth(world_of(1)))
    assert max(np.abs(errors["bias_mg"]).max(), np.abs(errors["scale_per_mille"]).max()) < 0.3
