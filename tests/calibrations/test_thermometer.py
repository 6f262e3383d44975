"""The temperature of a sensor from that of a thermometer that follows it, or that it follows."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.effects.logged import RATE, leading_temperature, sensor_temperature_c, temperature_rate_c_s
from calibrations.table import Array, Table

STEP_S = 8.0
T_S = STEP_S * np.arange(600)


def table(temperature_c: Array, t_s: Array = T_S) -> Table:
    columns = {"t_s": t_s, "temperature_c": temperature_c}
    angles = {"alpha_deg": np.full(len(t_s), 90.0), "beta_deg": np.linspace(0, 360, len(t_s))}
    return Table.from_columns("poses", columns | angles | {"vx_v": np.cos(np.radians(angles["beta_deg"]))})


def behind(x: Array, time_constant_s: float) -> Array:
    """x behind a first-order lag, in small steps of an explicit Euler scheme."""
    fine = np.interp(np.arange(0.0, T_S[-1], 0.05), T_S, x)
    y = np.empty_like(fine)
    y[0] = x[0]
    for i in range(len(y) - 1):
        y[i + 1] = y[i] + 0.05 / time_constant_s * (fine[i] - y[i])
    return np.interp(T_S, np.arange(0.0, T_S[-1], 0.05), y)


def wandering(seed: int) -> Array:
    steps = np.random.default_rng(seed).normal(0, 0.02, len(T_S))
    return 22.0 + np.cumsum(steps) + 0.3 * np.sin(2 * np.pi * T_S / 900)


def rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2)))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("tau", [40.0, 200.0])
def test_a_sensor_is_found_ahead_of_a_slow_and_noisy_thermometer(tau: float, seed: int) -> None:
    die = wandering(seed)
    shown = behind(die, tau) + np.random.default_rng(seed + 9).normal(0, 0.005, len(die))
    found = leading_temperature(table(shown), tau)
    assert rms(found - die) < 0.35 * rms(shown - die)


def test_a_slow_sensor_is_found_behind_a_fast_thermometer() -> None:
    air = wandering(1)
    assert leading_temperature(table(air), -150.0) == pytest.approx(behind(air, 150.0), abs=0.02)


def test_without_a_lead_the_readings_are_as_logged() -> None:
    shown = wandering(2)
    assert sensor_temperature_c(table(shown), 0.0) == pytest.approx(shown, abs=0)


@pytest.mark.parametrize("lead_s", [-90.0, 90.0])
def test_rows_of_one_time_have_one_temperature_of_the_sensor(lead_s: float) -> None:
    twice = table(np.repeat(wandering(4), 2), np.repeat(T_S, 2))
    once = leading_temperature(table(wandering(4)), lead_s)
    assert rms(leading_temperature(twice, lead_s)[::2] - once) < 0.1


@pytest.mark.parametrize("lead_s", [-90.0, 0.0, 90.0])
def test_a_constant_temperature_and_one_without_times_are_as_logged(lead_s: float) -> None:
    still = np.full(len(T_S), 21.5)
    assert leading_temperature(table(still), lead_s) == pytest.approx(still, abs=1e-9)
    shown = wandering(3)
    assert leading_temperature(table(shown, np.zeros(len(T_S))), lead_s) == pytest.approx(shown, abs=0)


def test_the_rate_of_a_ramp_is_its_slope_and_a_single_row_needs_it() -> None:
    ramp = 20 + 0.01 * T_S
    assert temperature_rate_c_s(table(ramp)) == pytest.approx(0.01, rel=1e-3)
    one = Table.from_columns(
        "poses",
        {"t_s": np.zeros(1), "alpha_deg": np.zeros(1), "beta_deg": np.zeros(1), "vx_v": np.zeros(1),
         "temperature_c": np.array([25.0]), RATE: np.array([0.01])},
    )  # fmt: skip
    assert sensor_temperature_c(one, 100.0) == pytest.approx(26.0)
