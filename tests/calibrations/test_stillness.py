"""The test of rest: its false alarms, and the motions that it sees."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from calibrations.analyses.stillness import (
    FALSE_ALARM,
    LEARNED_WINDOWS,
    NoiseAtRest,
    judge_window,
    learn_noise,
)
from calibrations.table import Array

RATE_HZ = 200.0
WINDOW = 100
NOISE_V = np.array([1.0e-3, 1.4e-3, 0.8e-3])


def at_rest(windows: int, seed: int, corner_hz: float = 15.0) -> list[Array]:
    """Windows of three axes behind a filter."""
    kept = np.exp(-2 * np.pi * corner_hz / RATE_HZ)
    white = np.random.default_rng(seed).standard_normal((500 + windows * WINDOW, 3))
    samples = NOISE_V * lfilter([np.sqrt(1 - kept**2)], [1.0, -kept], white, axis=0)[500:]
    return list(samples.reshape(windows, WINDOW, 3))


@pytest.fixture(scope="module")
def noise() -> NoiseAtRest:
    found = learn_noise(at_rest(LEARNED_WINDOWS, 1), RATE_HZ)
    assert found is not None
    return found


def alarms(corner_hz: float, sensors: int) -> float:
    """Share of windows at rest that count as motion: rests of 4 windows, each sensor with a noise of its own."""
    found = []
    for seed in range(sensors):
        windows = at_rest(LEARNED_WINDOWS + 100, seed, corner_hz)
        noise = learn_noise(windows[:LEARNED_WINDOWS], RATE_HZ)
        if noise is not None:
            rests = windows[LEARNED_WINDOWS:]
            found += [not judge_window(rests[k : k + j], noise).still for k in range(0, 97, 4) for j in (1, 2, 3, 4)]
    return float(np.mean(found))


def test_a_sensor_at_rest_rarely_counts_as_moving() -> None:
    assert alarms(15.0, 20) <= 3 * FALSE_ALARM  # 2,000 windows


@pytest.mark.slow
@pytest.mark.parametrize("corner_hz", [5.0, 15.0, 50.0])
def test_the_false_alarms_are_those_that_are_stated(corner_hz: float) -> None:
    assert alarms(corner_hz, 150) <= 1.4 * FALSE_ALARM  # 15,000 windows: a standard error of 0.26


def test_most_sensors_show_their_noise_in_the_first_ten_seconds() -> None:
    assert sum(learn_noise(at_rest(LEARNED_WINDOWS, seed), RATE_HZ) is not None for seed in range(50)) >= 48


@pytest.mark.parametrize(
    ("amplitude", "hz", "by"),
    [(2e-3, 3.0, "sway"), (2e-3, 9.0, "shake"), (2e-3, 40.0, "shake"), (3e-3, 1.0, "sway"), (1e-3, 80.0, "shake")],
)
def test_a_tremor_counts_as_motion(noise: NoiseAtRest, amplitude: float, hz: float, by: str) -> None:
    window = at_rest(1, 99)[0]
    window = window + amplitude * np.sin(2 * np.pi * hz * np.arange(WINDOW) / RATE_HZ + 0.3)[:, None]
    found = judge_window([window], noise)
    assert not found.still
    assert found.by == by
    assert found.noise > 1.2


def test_a_slow_slip_counts_as_motion_over_several_windows(noise: NoiseAtRest) -> None:
    """0.5 mg a second is hidden in each window."""
    windows = at_rest(8, 98)
    slipping = [w + 0.5e-3 * (k + np.arange(WINDOW) / WINDOW)[:, None] / 2 for k, w in enumerate(windows)]
    assert all(judge_window([w], noise).still for w in slipping)
    found = judge_window(slipping, noise)
    assert (found.still, found.by) == (False, "creep")


def test_the_noise_is_not_learned_from_a_sensor_that_was_touched() -> None:
    windows = at_rest(LEARNED_WINDOWS, 3)
    assert learn_noise(windows[1:], RATE_HZ) is None
    touched = [w + (0.02 if k == 7 else 0.0) * np.linspace(0, 1, WINDOW)[:, None] for k, w in enumerate(windows)]
    assert learn_noise(touched, RATE_HZ) is None
    drifting = [w + 1e-3 * k for k, w in enumerate(windows)]
    assert learn_noise(drifting, RATE_HZ) is None


def test_few_samples_in_a_block_leave_the_sway() -> None:
    rng = np.random.default_rng(6)
    windows = list(rng.standard_normal((LEARNED_WINDOWS + 1, 10, 3)))  # 20 Hz
    noise = learn_noise(windows[:-1], 20.0)
    assert noise is not None
    assert judge_window(windows[-1:], noise).still
    assert not judge_window([windows[-1] + np.arange(10)[:, None]], noise).still
