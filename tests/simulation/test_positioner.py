"""The carriage against its own equation of motion, integrated step by step."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from drivers.world.kernel import record
from drivers.world.positioner import (
    Command,
    Positioner,
    follow_command,
    hold_command,
    motion,
    normal_at,
    places_um,
    read_um,
)
from tests.carriages import at_rest

LOOP = record(Positioner(servo_hz=120.0, damping_fraction=0.8))
SINE = Command(0.02, 50.0, amplitude_um=30.0, frequency_hz=10.0, phase_rad=-math.pi / 2)
RAMP = Command(0.02, 20.0, rate_um_s=1000.0, end_s=0.05)


def integrated_um(command: Command, start_um: float, times_s: np.ndarray) -> np.ndarray:
    """x'' + 2 d w x' + w^2 x = w^2 u, numerically."""
    own = 2 * math.pi * LOOP.servo_hz

    def slopes(t: float, state: np.ndarray) -> list[float]:
        x, v = state
        return [v, own**2 * (command.um(t) - x) - 2 * LOOP.damping_fraction * own * v]

    span = (command.start_s, times_s[-1])
    return solve_ivp(slopes, span, [start_um, 0.0], t_eval=times_s, rtol=1e-9, atol=1e-9, max_step=1e-3).y[0]


@pytest.mark.parametrize("command", [SINE, RAMP, Command(0.02, 60.0, end_s=0.02)])
def test_it_follows_its_equation_of_motion(command: Command) -> None:
    pieces, _ = follow_command(LOOP, at_rest(20.0), command)
    times = np.linspace(0.02, 0.3, 400)
    assert places_um(LOOP, pieces, times) == pytest.approx(integrated_um(command, 20.0, times), abs=1e-5)


def test_speed_and_acceleration_are_the_derivatives() -> None:
    pieces, _ = follow_command(LOOP, at_rest(20.0), SINE)
    step = 1e-5
    for t in np.linspace(0.021, 0.4, 50):
        before, now, after = (motion(LOOP, pieces, t + k * step) for k in (-1, 0, 1))
        assert now[1] == pytest.approx((after[0] - before[0]) / (2 * step), abs=0.5)
        assert now[2] == pytest.approx((after[1] - before[1]) / (2 * step), rel=1e-3, abs=50.0)


def test_the_paper_s_motion_has_the_paper_s_acceleration() -> None:
    """60 um peak to peak at 10 Hz: 30 um (2 pi 10 Hz)^2 = 118.4 mm/s^2, less 1 % that the loop takes (Ang V)."""
    pieces, _ = follow_command(LOOP, at_rest(20.0), SINE)
    peak = max(motion(LOOP, pieces, t)[2] for t in np.linspace(1.0, 1.1, 1001))
    ratio = 10 / LOOP.servo_hz
    lag = math.hypot(1 - ratio**2, 2 * LOOP.damping_fraction * ratio)
    assert 1e-3 * peak == pytest.approx(118.4 / lag, rel=1e-3)


def test_a_new_command_goes_on_where_the_old_one_is() -> None:
    swinging, _ = follow_command(LOOP, at_rest(20.0), SINE)
    braked, rest_s = follow_command(LOOP, swinging, hold_command(40.0, 1.0123))
    before, after = motion(LOOP, swinging, 1.0123), motion(LOOP, braked, 1.0123)
    assert after[:2] == pytest.approx(before[:2], rel=1e-9)
    assert motion(LOOP, braked, rest_s) == pytest.approx((40.0, 0.0, 0.0), abs=1e-3)
    assert rest_s < 1.0123 + 0.1


def test_a_wave_of_some_cycles_ends_where_it_began() -> None:
    command = Command(0.0, 50.0, amplitude_um=30.0, frequency_hz=10.0, phase_rad=-math.pi / 2, end_s=0.3)
    pieces, rest_s = follow_command(LOOP, at_rest(20.0), command)
    assert command.moving(0.299)
    assert not command.moving(0.3)
    assert motion(LOOP, pieces, rest_s)[0] == pytest.approx(20.0, abs=1e-6)


def test_endless_waves_are_known_for_days() -> None:
    pieces, _ = follow_command(LOOP, at_rest(20.0), SINE)
    assert motion(LOOP, pieces, 86400.3)[0] == pytest.approx(motion(LOOP, pieces, 1.3)[0], abs=1e-4)


def test_noise_belongs_to_the_instant() -> None:
    times = np.arange(20_000) * 50e-6
    noise = 1e3 * (read_um(LOOP, at_rest(50.0), times, 1) - 50.0)
    assert noise.std() == pytest.approx(LOOP.noise_nm, rel=0.02)
    assert noise.mean() == pytest.approx(0.0, abs=0.03)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.03
    assert np.array_equal(read_um(LOOP, at_rest(50.0), times[100:200], 1), 50.0 + 1e-3 * noise[100:200])
    assert not np.array_equal(normal_at(np.arange(5), 1), normal_at(np.arange(5), 2))
