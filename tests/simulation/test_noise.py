from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.world.config import WorldConfig
from drivers.world.noise import FLICKER_S
from drivers.world.stage import Trajectory
from drivers.world.world import World

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


def test_white_noise_is_normal_out_to_its_tails() -> None:
    """Samples 0.2 s apart are independent; the bounds are 4 standard errors."""
    z = samples(400_000, interval_s=0.2, flicker_v=0.0)[:, 0]
    z = (z - z.mean()) / 0.775e-3
    n = len(z)
    assert (z**2).mean() == pytest.approx(1.0, abs=4 * math.sqrt(2 / n))
    assert (z**3).mean() == pytest.approx(0.0, abs=4 * math.sqrt(15 / n))
    assert (z**4).mean() == pytest.approx(3.0, abs=4 * math.sqrt(96 / n))
    for limit in (1.0, 2.0, 3.0, 4.0):
        beyond = math.erfc(limit / math.sqrt(2))
        assert np.mean(np.abs(z) > limit) == pytest.approx(beyond, abs=4 * math.sqrt(beyond / n))


def test_the_converters_noise_is_new_in_every_sample_and_channel() -> None:
    config = WorldConfig.ideal().changed({"converter": {"noise_v": 1e-3}})
    volts = World(config, seed=3).adc_volts(["ground", "ground"], 0.0, 1e-3, 100_000) / 1e-3
    x = volts.ravel()  # in the order in which they were drawn
    assert x.std() == pytest.approx(1.0, abs=0.01)
    for lag in (1, 2, 3, 7):
        assert abs(np.mean(x[:-lag] * x[lag:])) < 4 / math.sqrt(len(x))


def test_flicker_noise_wanders_as_the_sum_of_its_decades() -> None:
    """Mean square of what it wanders over a lag: 2 rms^2 (1 - exp(-lag / T)) of each correlation time T."""
    x = samples(200_000, interval_s=0.5, white_v=0.0, flicker_v=1e-4)
    for lag_s in (0.5, 1.0, 5.0, 20.0):
        wandered = x[round(lag_s / 0.5) :] - x[: -round(lag_s / 0.5)]
        expected = sum(2e-8 * (1 - math.exp(-lag_s / time_s)) for time_s in FLICKER_S)
        assert np.mean(wandered**2, axis=0) == pytest.approx(np.full(2, expected), rel=0.06)


def test_the_noise_does_not_depend_on_the_rate() -> None:
    assert samples(interval_s=7e-3).std(axis=0) == pytest.approx(0.775e-3, rel=0.03)


def test_flicker_noise_averages_out_slowly() -> None:
    x = samples(1_000_000, white_v=0.0, flicker_v=1e-4)[:, 0]
    short, long = (np.diff(x.reshape(-1, n).mean(axis=1)).std() for n in (1000, 20_000))
    assert 0.5 < long / short < 2.0  # white noise would fall by 4.5, a random walk rise by 4.5


@pytest.mark.slow
def test_a_random_walk_spreads_with_the_square_root_of_time() -> None:
    spreads = []
    for seed in range(100):
        config = WorldConfig.ideal().changed({"noise": {"white_v": 0.0, "walk_v_per_sqrt_h": 1e-3}})
        world = World(config, seed)
        values = [world.adc_volts(["vx", "vy"], hours * 3600.0, 1e-3, 1) for hours in (0.0, 0.25, 1.0)]
        spreads.append([values[1] - values[0], values[2] - values[0]])
    assert np.std(spreads, axis=(0, 2, 3)) == pytest.approx([0.5e-3, 1e-3], rel=0.2)


def test_hum_is_one_line_of_the_spectrum() -> None:
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
