"""The default sensor shows what Ang et al. saw (sections III.A and III.B of their paper)."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.world.config import WorldConfig
from drivers.world.world import World

SEEDS = range(3)


def path(world: World, alpha_deg: float, turn_deg: np.ndarray) -> dict[str, np.ndarray]:
    """One full turn each way, after one to run in."""
    world.dwell_mean(alpha_deg, turn_deg, dwell_s=0.1, noise_free=True)
    return world.dwell_mean(alpha_deg, turn_deg, dwell_s=0.1, noise_free=True)


def opening(volts: np.ndarray) -> np.ndarray:
    """Width of the hysteretic path at every beta."""
    half = len(volts) // 2
    return np.abs(volts[:half] - volts[half:][::-1])


@pytest.mark.parametrize("seed", SEEDS)
def test_paths_open_by_10_mv_where_the_other_axis_is_loaded_most(seed: int, turn_deg, silent) -> None:
    table = path(World(silent, seed), 90.0, turn_deg)
    x, y = opening(table["vx_v"]), opening(table["vy_v"])
    beta = turn_deg[: len(x)]
    for width, load in ((x, np.sin(np.radians(beta))), (y, np.cos(np.radians(beta)))):
        assert 5e-3 < width.max() < 20e-3
        assert abs(load[width.argmax()]) > 0.98
        assert width[np.abs(load) < 0.01].max() < 0.1 * width.max() + 0.5e-3


@pytest.mark.parametrize("seed", SEEDS)
def test_the_whole_path_moves_up_with_alpha_and_not_in_parallel(seed: int, turn_deg, silent) -> None:
    world = World(silent, seed)
    paths = [path(world, alpha, turn_deg)["vx_v"] for alpha in (30.0, 90.0, 150.0)]
    middles = [(p[0] + p[18]) / 2 for p in paths]
    assert np.all(np.diff(middles) > 5e-3)
    scales = [(p[0] - p[18]) / 2 / np.sin(np.radians(a)) for p, a in zip(paths, (30, 90, 150), strict=True)]
    assert np.ptp(scales) > 2e-3


@pytest.mark.parametrize("seed", SEEDS)
def test_level_paths_do_not_depend_on_beta(seed: int, turn_deg, silent) -> None:
    volts = path(World(silent, seed), 180.0, turn_deg)["vx_v"]
    assert np.ptp(volts) < 5e-3


@pytest.mark.parametrize("seed", SEEDS)
def test_the_makers_linear_model_is_wrong_by_30_mg(seed: int, turn_deg, silent) -> None:
    world = World(silent, seed)
    upright, inclined = path(world, 90.0, turn_deg), path(world, 45.0, turn_deg)
    v = upright["vx_v"]
    scale, bias = (v[0] - v[18]) / 2, (v[0] + v[18]) / 2
    at_90 = inclined["vx_v"][turn_deg == 90.0]
    assert 0.020 < abs(np.mean((at_90 - bias) / scale)) < 0.045


@pytest.mark.parametrize("seed", SEEDS)
def test_bias_and_scale_factor_warm_up_over_hours(seed: int, silent) -> None:
    config = silent.changed({"heat": {"powered_for_s": 0.0, "ambient_wander_k": 0.0}, "supply": {"wander_v": 0.0}})
    world, hours = World(config, seed), np.arange(0.0, 14.0, 0.25)
    biases, scales = [], []
    for hour in hours:
        world.advance(max(world.now_s, 3600.0 * hour))
        up, down = world.dwell_mean([90.0, 90.0], [0.0, 180.0], noise_free=True)["vx_v"]
        biases.append((up + down) / 2)
        scales.append((up - down) / 2)
    for drift in (np.array(biases), np.array(scales)):
        rest = np.abs(drift - drift[-1]) / np.abs(drift[0] - drift[-1])
        steady = hours[np.nonzero(rest > 0.02)[0][-1] + 1]
        assert 2.0 <= steady <= 12.0
    assert np.ptp(biases) > 1e-3
    assert np.ptp(scales) > 3e-4


def test_the_ideal_sensor_is_perfectly_linear(turn_deg) -> None:
    world = World(WorldConfig.ideal(), seed=1)
    for alpha in (90.0, 30.0, 135.0):
        table = world.dwell_mean(alpha, turn_deg, noise_free=True)
        a, b = np.radians(table["alpha_deg"]), np.radians(table["beta_deg"])
        for axis, load in (("x", np.sin(a) * np.cos(b)), ("y", np.sin(a) * np.sin(b))):
            plates = getattr(world.config.sensor, axis).plates
            line = plates.zero_g_v + plates.sensitivity_v_per_g * load
            assert table[f"v{axis}_v"] == pytest.approx(line, abs=1e-9)
