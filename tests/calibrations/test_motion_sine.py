"""Sine approximation: as certain as the Cramer-Rao bound allows, and without bias."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from calibrations.errors import DataError
from calibrations.motion.reference import Sine, find_sines, fit_four_parameter, strongest_line

RATE = 1000.0
T = 50.0 + np.arange(4000) / RATE
TRUE = {"amplitude": 30e-6, "frequency": 10.03, "phase": 0.7, "offset": 4e-6}
NOISE = 0.5e-6
SEEDS = 250


def made(seed: int) -> np.ndarray:
    wave = np.cos(2 * np.pi * TRUE["frequency"] * T + TRUE["phase"])
    return TRUE["offset"] + TRUE["amplitude"] * wave + NOISE * np.random.default_rng(seed).standard_normal(len(T))


def of_many(fit: object) -> list[Sine]:
    return [fit(made(seed)) for seed in range(SEEDS)]


def test_amplitude_reaches_the_cramer_rao_bound() -> None:
    found = of_many(lambda x: fit_four_parameter(T, x))
    bound = NOISE * np.sqrt(2 / len(T))
    amplitudes = np.array([s.amplitude for s in found])
    assert abs(amplitudes.mean() / TRUE["amplitude"] - 1) < 1e-4
    assert amplitudes.std() < 1.1 * bound
    assert np.mean([s.amplitude_std for s in found]) == pytest.approx(bound, rel=0.03)


def test_the_standard_uncertainty_of_the_frequency_is_the_scatter() -> None:
    found = of_many(lambda x: fit_four_parameter(T, x))
    duration = len(T) / RATE
    stated_hz = np.mean([s.frequency_std_hz for s in found])
    assert np.std([s.frequency_hz for s in found]) == pytest.approx(stated_hz, rel=0.15)
    ratio = NOISE / TRUE["amplitude"]
    assert stated_hz == pytest.approx(ratio * np.sqrt(24 / len(T)) / (2 * np.pi * duration), rel=0.03)  # Rife, 1974
    late = np.mean([s.phase_rad for s in found]) - TRUE["phase"]
    assert abs(late) < 4 * 2 * ratio * np.sqrt(2 / len(T) / SEEDS)


def test_uncertainty_holds_for_noise_behind_a_low_pass() -> None:
    rho = np.exp(-2 * np.pi * 15 / RATE)
    found = []
    for seed in range(100):
        noise = lfilter([1 - rho], [1, -rho], np.random.default_rng(seed).standard_normal(len(T)))
        found.append(fit_four_parameter(T, 10 * np.cos(2 * np.pi * 10 * T) + noise, 10.0))
    scatter, told = np.std([s.amplitude for s in found]), np.mean([s.amplitude_std for s in found])
    assert told == pytest.approx(scatter, rel=0.2)


def test_lines_are_found_beside_each_other() -> None:
    x = made(0) + 2e-6 * np.cos(2 * np.pi * 17.4 * T) + 50e-6 * np.cos(2 * np.pi * 4.2 * T - 1)
    found = find_sines(T, x)
    assert [round(s.frequency_hz, 1) for s in found] == [4.2, 10.0, 17.4]
    for line, amplitude in zip(found, (50e-6, 30e-6, 2e-6), strict=True):
        assert abs(line.amplitude - amplitude) < 5 * line.amplitude_std


def test_no_line_is_found_in_noise() -> None:
    assert sum(len(find_sines(T, np.random.default_rng(seed).standard_normal(len(T)))) for seed in range(60)) == 0
    assert strongest_line(T, made(0))[0] == pytest.approx(10.03, abs=0.01)


def test_a_sine_fit_of_too_few_samples_is_refused(golden) -> None:
    with golden.refused(DataError):
        fit_four_parameter(T[:5], T[:5], 10.0)
