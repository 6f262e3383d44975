"""Every random process of the world against its theory, by spectra of scipy and Allan deviations of allantools.

Spectra are one-sided, averaged over seeds and over bands of frequency; Book 17.3, IEEE 952 annex C.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from itertools import pairwise

import allantools
import numpy as np
import pytest
from scipy import signal

from drivers.world.config import WorldConfig
from drivers.world.world import World

QUIET: dict[str, object] = {"white_v": 0.0, "flicker_v": 0.0}
SEEDS = 4
FILTER_S = 32e3 * 0.33e-6
EVERYTHING: dict[str, object] = {
    "flicker_v": 2e-4,
    "flicker_fastest_s": 0.01,
    "walk_v_per_sqrt_h": 1e-3,
    "wander_v": 3e-4,
    "wander_s": 40.0,
    "ramp_v_per_h": 2e-3,
    "hum_v": 1e-3,
    "pulse_v_s": 1e-6,
    "y": {"wander_s": 0.2, "hum_hz": 60.0},
}


def world(seed: int, noise: Mapping[str, object], **more: object) -> World:
    return World(WorldConfig.ideal().changed({"noise": noise, **more}), seed)


def samples(seed: int, interval_s: float, n: int, **noise: object) -> np.ndarray:
    """Both outputs about their means, (n, 2)."""
    volts = world(seed, {**QUIET, **noise}).adc_volts(["vx", "vy"], 0.0, interval_s, n)
    return volts - volts.mean(axis=0)


def spectrum(interval_s: float, n: int, **noise: object) -> tuple[np.ndarray, np.ndarray]:
    """(frequencies, density) of both outputs of SEEDS worlds."""
    records = np.concatenate([samples(seed, interval_s, n, **noise).T for seed in range(SEEDS)])
    f, density = signal.welch(records, 1 / interval_s, nperseg=n // 8, detrend="constant")
    return f[2:], density[:, 2:].mean(axis=0)


def bands(f: np.ndarray, ratio: np.ndarray, edges: tuple[float, ...]) -> np.ndarray:
    """Mean of `ratio` between neighbouring frequencies of `edges`."""
    inside = [(f >= low) & (f < high) for low, high in pairwise(edges)]
    return np.array([ratio[each].mean() for each in inside])


def oadev(values: np.ndarray, rate_hz: float, taus: list[float]) -> np.ndarray:
    return np.asarray(allantools.oadev(values, rate=rate_hz, data_type="freq", taus=taus)[1])


def mean_oadev(interval_s: float, n: int, taus: list[float], **noise: object) -> np.ndarray:
    """Root mean square over SEEDS worlds and both outputs."""
    found = [oadev(x, 1 / interval_s, taus) for k in range(SEEDS) for x in samples(k, interval_s, n, **noise).T]
    return np.sqrt(np.mean(np.square(found), axis=0))


def test_white_noise_has_a_flat_spectrum_up_to_the_filter() -> None:
    f, density = spectrum(1e-3, 200_000, white_v=1e-3)
    expected = 4e-6 * FILTER_S / (1 + (2 * math.pi * f * FILTER_S) ** 2)
    assert bands(f, density / expected, (0.1, 1.0, 5.0, 20.0, 50.0)) == pytest.approx(np.ones(4), rel=0.06)


@pytest.mark.parametrize(("interval_s", "n", "fastest_s", "edges"), [
    (1e-3, 400_000, 0.01, (0.3, 1.0, 3.0, 6.0)),
    (0.5, 60_000, 1.0, (5e-4, 2e-3, 1e-2, 0.05)),
])  # fmt: skip
def test_flicker_noise_falls_with_frequency_over_four_decades(
    interval_s: float, n: int, fastest_s: float, edges: tuple[float, ...]
) -> None:
    f, density = spectrum(interval_s, n, flicker_v=1e-3, flicker_fastest_s=fastest_s)
    assert bands(f, density * f * math.log(10) / 1e-6, edges) == pytest.approx(np.ones(len(edges) - 1), rel=0.2)


def test_flicker_noise_does_not_average_out() -> None:
    """Its Allan deviation is flat at sqrt(2 ln 2 / pi) of the bias instability, which is flicker_v sqrt(pi / ln 10)."""
    flat = 1e-3 * math.sqrt(2 * math.log(2) / math.log(10))
    taus = [10.0, 40.0, 160.0]
    assert mean_oadev(0.5, 20_000, taus, flicker_v=1e-3) == pytest.approx(np.full(3, flat), rel=0.15)


def test_a_walk_rises_with_the_root_of_time() -> None:
    k = 1e-3 / 60  # V/sqrt(s)
    taus = [2.0, 8.0, 32.0]
    expected = k * np.sqrt(np.array(taus) / 3)
    assert mean_oadev(0.5, 20_000, taus, walk_v_per_sqrt_h=1e-3) == pytest.approx(expected, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("time_s", "interval_s", "edges"), [
    (20.0, 2.0, (1e-3, 8e-3, 2e-2, 5e-2)),
    (0.05, 1e-3, (0.1, 1.0, 5.0, 20.0)),
])  # fmt: skip
def test_a_wander_is_gauss_markov_slow_or_fast(time_s: float, interval_s: float, edges: tuple[float, ...]) -> None:
    f, density = spectrum(interval_s, 40_000, wander_v=1e-3, wander_s=time_s)
    rho = math.exp(-interval_s / time_s)  # of a sampled process
    expected = 2e-6 * interval_s * (1 - rho**2) / (1 - 2 * rho * np.cos(2 * math.pi * f * interval_s) + rho**2)
    assert bands(f, density / expected, edges) == pytest.approx(np.ones(3), rel=0.12)


def test_a_simulated_ramp_is_straight() -> None:
    volts = world(1, QUIET | {"ramp_v_per_h": 5e-3}).adc_volts(["vx"], 0.0, 1.0, 3000)[:, 0]
    assert 3600 * np.polyfit(np.arange(3000.0), volts, 1)[0] == pytest.approx(5e-3, rel=1e-3)


def test_pulses_round_the_sum_and_not_the_samples() -> None:
    """Quantisation noise: the Allan deviation falls with time itself, sqrt(3) Q / tau, Q = pulse / sqrt(12)."""
    taus = [1e-3, 2e-3, 32e-3]
    white = mean_oadev(1e-3, 20_000, taus, white_v=1e-3)
    both = mean_oadev(1e-3, 20_000, taus, white_v=1e-3, pulse_v_s=2e-6)
    expected = math.sqrt(3) * 2e-6 / math.sqrt(12) / np.array(taus)
    assert np.sqrt(both**2 - white**2)[:2] == pytest.approx(expected[:2], rel=0.05)
    assert both[2] < 1.3 * white[2]


def test_the_output_comes_in_whole_pulses() -> None:
    volts = world(1, {"pulse_v_s": 1e-5}).adc_volts(["vx", "vy"], 0.0, 1e-3, 500)[1:]
    assert np.allclose(volts / 1e-2, np.rint(volts / 1e-2), atol=1e-6)
    assert len(np.unique(np.rint(volts[:, 0] / 1e-2))) > 1


@pytest.mark.parametrize(("alpha_deg", "up_g", "along_g", "seen_g"), [
    (0.0, 1e-3, 0.0, 0.0),
    (90.0, 1e-3, 0.0, 1e-3),
    (0.0, 0.0, 2e-3, 2e-3),
])  # fmt: skip
def test_the_floor_shakes_what_points_its_way(alpha_deg: float, up_g: float, along_g: float, seen_g: float) -> None:
    floor = {"shaking_up_g": up_g, "shaking_along_g": along_g, "shaking_hz": 24.0}
    here = world(1, QUIET, floor=floor)
    here.dwell_mean([alpha_deg], 0.0)
    volts = here.adc_volts(["vx"], here.now_s + 1.0, 1e-3, 1000)[:, 0]
    line = 2 * np.abs(np.fft.rfft(volts - volts.mean())) / 1000
    gain = 1 / math.hypot(1.0, 2 * math.pi * 24 * FILTER_S)
    assert line[24] == pytest.approx(seen_g * gain, rel=0.03, abs=1e-7)
    assert np.delete(line, 24).max() < 1e-3 * gain * 0.02


def test_each_output_has_its_own_noise() -> None:
    only_x = samples(1, 1e-3, 20_000, x={"white_v": 1e-3}, y={"hum_v": 1e-3}).std(axis=0)
    assert only_x == pytest.approx([1e-3, 1e-3 / math.sqrt(2)], rel=0.1)
    both = samples(1, 1e-3, 20_000, flicker_v=1e-3, flicker_fastest_s=0.01)
    assert abs(np.corrcoef(np.diff(both, axis=0).T)[0, 1]) < 0.05


def test_an_interrupted_world_goes_on_sample_for_sample_with_every_process() -> None:
    floor = {"shaking_along_g": 1e-3}
    whole = world(5, EVERYTHING, floor=floor).adc_volts(["vx", "vy"], 0.0, 1e-3, 3000)
    first = world(5, EVERYTHING, floor=floor)
    begun = [first.adc_volts(["vx", "vy"], 0.0, 1e-3, 700), first.adc_volts(["vx", "vy"], 0.7, 1e-3, 800)]
    kept = json.loads(json.dumps(first.state()))
    later = world(5, EVERYTHING, floor=floor)
    later.restore(kept)
    ended = later.adc_volts(["vx", "vy"], 1.5, 1e-3, 1500)
    assert np.array_equal(np.concatenate([*begun, ended]), whole)


def test_another_seed_is_another_noise() -> None:
    first, second = (world(seed, EVERYTHING).adc_volts(["vx"], 0.0, 1e-3, 500)[:, 0] for seed in (1, 2))
    assert abs(np.corrcoef(np.diff(first), np.diff(second))[0, 1]) < 0.8


@pytest.mark.parametrize("noise", [
    {"flicker_v": 5e-4, "flicker_fastest_s": 0.01},
    {"wander_v": 5e-4, "wander_s": 0.2},
    {"wander_v": 5e-4, "wander_s": 8.0},
    {"walk_v_per_sqrt_h": 2e-2},
    {"pulse_v_s": 2e-6, "white_v": 2e-4},
    {"hum_v": 1e-3, "hum_hz": 0.37},
])  # fmt: skip
def test_means_of_dwells_scatter_as_their_samples_do(noise: Mapping[str, object]) -> None:
    """Differences of every second mean of 1 s, and the spread within each."""
    count, n = 600, 1000
    config = {**QUIET, **noise}
    taken = world(3, config).adc_volts(["vx", "vy"], 0.0, 1e-3, count * n).reshape(count, n, 2)
    dwelt = world(4, config).dwell_mean(np.zeros(count), 0.0, dwell_s=1.0, settle_s=0.0)
    means = np.column_stack([dwelt["vx_v"], dwelt["vy_v"]])
    rounding = 20 / 2**16 / math.sqrt(12 * n)
    sampled, told = (np.diff(each[::2], axis=0).std() for each in (taken.mean(axis=1), means))
    assert told == pytest.approx(math.hypot(sampled, math.sqrt(2) * rounding), rel=0.12)
    within = np.sqrt(np.mean(np.square([dwelt["vx_std_v"], dwelt["vy_std_v"]])))
    assert within == pytest.approx(math.hypot(np.sqrt(taken.var(axis=1).mean()), 20 / 2**16 / math.sqrt(12)), rel=0.08)


def test_every_process_is_a_setting_of_a_bench_file() -> None:
    config = WorldConfig.from_mapping({"noise": EVERYTHING, "floor": {"shaking_up_g": 1e-3}})
    assert (config.noise.x.wander_s, config.noise.y.wander_s) == (40.0, 0.2)
    assert config.noise.x.hum_v == config.noise.y.hum_v == 1e-3
    assert config.floor.shaking_up_g == 1e-3
