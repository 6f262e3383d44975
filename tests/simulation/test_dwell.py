from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from drivers.world import visit
from drivers.world.config import WorldConfig
from drivers.world.stage import Trajectory
from drivers.world.visit import Timing, path_direction
from drivers.world.world import World

ALPHA = np.array([90.0, 90.0, 30.0, 30.0, 135.0, 135.0])
BETA = np.array([0.0, 90.0, 200.0, 360.0, 250.0, 10.0])


def sampled(world: World, alpha_deg: float, beta_deg: float) -> np.ndarray:
    """Move as a visit does and take 5 s of samples: the outputs (5000, 2)."""
    now_s = world.now_s
    for axis, target in (("alpha", alpha_deg), ("beta", beta_deg)):
        here = world.motor_angle_deg(axis)
        if here != target:
            move = Trajectory(now_s, here, target, 20.0, 40.0)
            world.move_stage(axis, move)
            now_s = move.end_s
    volts = world.adc_volts(["vx", "vy"], now_s + 0.5, 1e-3, 5000)
    world.advance(now_s + 5.5)
    return volts


def test_means_agree_with_averaged_samples_to_a_microvolt(silent: WorldConfig) -> None:
    means = World(silent, seed=4).dwell_mean(ALPHA, BETA)
    world = World(silent, seed=4)
    averages = np.array([sampled(world, a, b).mean(axis=0) for a, b in zip(ALPHA, BETA, strict=True)])
    expected = np.column_stack([means["vx_v"], means["vy_v"]])
    # without noise of the sensor, the rounding to codes is all that is left to chance
    rounding = visit.spreads(silent.noise.x, silent.converter, Timing())[0]
    assert np.abs(averages - expected).max() < 1e-6 + 4 * rounding
    free = World(silent, seed=4).dwell_mean(ALPHA, BETA, noise_free=True)
    assert np.abs(averages - np.column_stack([free["vx_v"], free["vy_v"]])).max() < 1e-6


def test_means_scatter_as_averaged_and_rounded_samples_do() -> None:
    config = WorldConfig.ideal().changed({"converter": {"noise_v": 2e-4}})
    world, step = World(config, seed=8), config.converter.step_v
    blocks = np.round(world.adc_volts(["vx", "vy"], 0.0, 1e-3, 5000 * 500) / step) * step
    averages = blocks.reshape(500, 5000, 2).mean(axis=1)
    stds = blocks.reshape(500, 5000, 2).std(axis=1, ddof=1)
    means = World(config, seed=9).dwell_mean(np.zeros(500), 0.0, settle_s=0.0)
    predicted, relative = visit.spreads(config.noise.x, config.converter, Timing())
    for seen in (averages.ravel() - np.tile(averages.mean(axis=0), 500), *(means[v] for v in ("vx_v", "vy_v"))):
        chi2 = len(seen) * seen.var() / predicted**2
        assert 0.001 < stats.chi2.cdf(chi2, len(seen)) < 0.999
    both = np.concatenate([means["vx_v"] - means["vx_v"].mean(), means["vy_v"] - means["vy_v"].mean()])
    assert averages.std(axis=0).mean() / both.std() == pytest.approx(1.0, abs=0.08)
    assert np.concatenate([means["vx_std_v"], means["vy_std_v"]]).mean() == pytest.approx(stds.mean(), rel=2e-3)
    assert stds.std() / stds.mean() == pytest.approx(relative, rel=0.15)


def test_the_predicted_spread_is_that_of_many_means() -> None:
    config = WorldConfig.ideal()
    means = World(config, seed=2).dwell_mean(np.zeros(4000), 0.0, dwell_s=0.5, settle_s=0.0)
    predicted = visit.spreads(config.noise.x, config.converter, Timing(dwell_s=0.5))[0]
    assert np.std(np.concatenate([means["vx_v"] - means["vx_v"].mean(), means["vy_v"] - means["vy_v"].mean()])) == (
        pytest.approx(predicted, rel=0.05)
    )


def test_a_dwells_noise_is_fifty_microvolts() -> None:
    assert visit.spreads(WorldConfig.ideal().noise.x, WorldConfig.ideal().converter, Timing())[0] == pytest.approx(
        50e-6, rel=0.02
    )


def test_hum_and_bow_have_the_means_of_their_samples() -> None:
    config = WorldConfig.ideal().changed(
        {"noise": {"white_v": 0.0, "hum_v": 0.2, "hum_hz": 0.13}, "converter": {"bow_v": 0.1, "skew_s": 0.0}}
    )
    averages = World(config, seed=1).adc_volts(["vx"], 0.5, 1e-3, 5000)[:, 0].mean()
    means = World(config, seed=1).dwell_mean([0.0], 0.0)
    assert means["vx_v"][0] == pytest.approx(averages, abs=5e-4)  # the hum's own curvature under the bow
    assert World(config, seed=1).dwell_mean([0.0], 0.0, noise_free=True)["vx_v"][0] != pytest.approx(averages, abs=0.01)


def test_a_simulated_table_has_the_columns_of_a_measured_one() -> None:
    world = World(WorldConfig.adxl203().changed({"heat": {"powered_for_s": 100.0}}), seed=1)
    table = world.dwell_mean([0.0, 30.0], [0.0, 40.0], mount_deg=[0.0, 90.0], flip=1)
    assert set(table) == {
        *("alpha_deg", "beta_deg", "vx_v", "vy_v", "t_s", "direction", "temperature_c", "supply_v"),
        *("mount_deg", "flip", "vx_std_v", "vy_std_v", "n"),
    }
    assert {len(column) for column in table.values()} == {2}
    assert table["t_s"][0] == pytest.approx(100.0 + 0.5 + 2.5)
    assert table["flip"].tolist() == [1, 1]
    assert table["n"].tolist() == [5000, 5000]
    assert world.now_s + 100.0 == pytest.approx(table["t_s"][1] + 2.5)


def test_direction_is_the_sign_of_the_last_or_else_the_next_move() -> None:
    assert path_direction(np.array([0.0, 10, 20, 20, 10, 0, 0])).tolist() == [1, 1, 1, -1, -1, -1, 0]


def test_noise_free_means_are_repeatable_and_free() -> None:
    free = World(WorldConfig.ideal(), seed=1).dwell_mean(ALPHA, BETA, noise_free=True)
    again = World(WorldConfig.ideal(), seed=1).dwell_mean(ALPHA, BETA, noise_free=True)
    assert np.array_equal(free["vx_v"], again["vx_v"])
    assert not free["vx_std_v"].any()
