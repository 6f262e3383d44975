from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.simulation.config import WorldConfig
from drivers.simulation.trajectory import Trajectory
from drivers.simulation.world import World

TAU_S = 32e3 * 0.33e-6


def samples(n: int = 200_000, interval_s: float = 1e-3, **noise: float) -> np.ndarray:
    world = World(WorldConfig.ideal().changed({"noise": noise}), seed=3)
    return world.adc_volts(["vx", "vy"], 0.0, interval_s, n)


def test_white_noise_behind_the_filter_has_its_rms_and_correlation() -> None:
    x, y = samples().T
    assert x.std() == pytest.approx(0.775e-3, rel=0.03)
    for lag in (1, 5, 20):
        correlation = np.corrcoef(x[:-lag], x[lag:])[0, 1]
        assert correlation == pytest.approx(math.exp(-lag * 1e-3 / TAU_S), abs=0.03)
    assert abs(np.corrcoef(x, y)[0, 1]) < 0.05


def test_the_noise_does_not_depend_on_the_rate() -> None:
    assert samples(interval_s=7e-3).std(axis=0) == pytest.approx(0.775e-3, rel=0.03)


def test_flicker_noise_averages_out_slowly() -> None:
    x = samples(1_000_000, white_v=0.0, flicker_v=1e-4)[:, 0]
    short, long = (np.diff(x.reshape(-1, n).mean(axis=1)).std() for n in (1000, 20_000))
    assert 0.5 < long / short < 2.0  # white noise would fall by 4.5, a random walk rise by 4.5


def test_a_random_walk_spreads_with_the_square_root_of_time() -> None:
    spreads = []
    for seed in range(30):
        config = WorldConfig.ideal().changed({"noise": {"white_v": 0.0, "walk_v_per_sqrt_h": 1e-3}})
        world = World(config, seed)
        values = [world.adc_volts(["vx", "vy"], hours * 3600.0, 1e-3, 1) for hours in (0.0, 0.25, 1.0)]
        spreads.append([values[1] - values[0], values[2] - values[0]])
    assert np.std(spreads, axis=(0, 2, 3)) == pytest.approx([0.5e-3, 1e-3], rel=0.25)


def test_hum_is_a_line() -> None:
    x = samples(1000, white_v=0.0, hum_v=1e-3, hum_hz=50.0)[:, 0]
    spectrum = np.abs(np.fft.rfft(x - x.mean())) / 500
    assert spectrum.argmax() == 50
    assert spectrum[50] == pytest.approx(1e-3, rel=1e-3)


def test_the_filter_follows_a_step_with_its_time_constant() -> None:
    world = World(WorldConfig.ideal().changed({"noise": {"white_v": 0.0}}), seed=1)
    world.move_stage("alpha", Trajectory(0.0, 0.0, 90.0, 1e5, 1e8))  # there in 2 ms
    volts = world.adc_volts(["vx"], 0.0, 1e-3, 200)[:, 0]
    rest = volts[-1] - volts
    assert rest[10] / rest[30] == pytest.approx(math.exp(20e-3 / TAU_S), rel=1e-6)


def test_the_supply_drifts_cycles_and_scales_the_output() -> None:
    config = WorldConfig.ideal().changed(
        {
            "noise": {"white_v": 0.0},
            "supply": {"nominal_v": 4.9, "drift_v_per_h": 0.1, "cycle_v": 0.01, "cycle_s": 40.0},
        }
    )
    world = World(config, seed=1)
    world.advance(3610.0)
    x, supply = world.adc_volts(["vx", "supply"], 3610.0, 1e-3, 1)[0]
    assert supply == pytest.approx(4.9 + 0.1 * 3610 / 3600 + 0.01)
    assert x / supply == pytest.approx(world.config.sensor.x.plates.zero_g_v / 5, abs=1e-6)
