"""The carriage shakes the sensor: through springs, plates and output filter, and before the displacement sensor."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from drivers.philtec_d63 import SIMULATED, CalibrationCurve
from drivers.world.config import WorldConfig
from drivers.world.errors import UnknownInput
from drivers.world.positioner import Command, hold_command
from drivers.world.stage import Trajectory
from drivers.world.world import World

QUIET = WorldConfig.ideal().changed(
    {"noise": {"white_v": 0.0}, "d63": {"noise_v": 0.0}, "positioner": {"noise_nm": 0.0}}
)
HZ, SWING_UM = 10.0, 30.0
GRAVITY = 9.80665


def sine(start_s: float, frequency_hz: float = HZ) -> Command:
    """60 um peak to peak from the lowest place on."""
    return Command(start_s, 50.0, amplitude_um=SWING_UM, frequency_hz=frequency_hz, phase_rad=-math.pi / 2)


def component(values: np.ndarray, frequency_hz: float, rate_hz: float, start_s: float) -> complex:
    """Amplitude and phase of a sine over whole periods: values = mean + |c| cos(2 pi f t + arg c)."""
    t = start_s + np.arange(len(values)) / rate_hz
    return complex(2 * np.mean((values - values.mean()) * np.exp(-2j * np.pi * frequency_hz * t)))


def shaken(world: World, axis: str = "x", frequency_hz: float = HZ, start_s: float = 5.0) -> np.ndarray:
    """One second of vx, vy and displacement, once everything is steady, while the carriage swings."""
    world.advance(start_s)
    world.move_positioner(axis, sine(start_s, frequency_hz))
    return world.adc_volts(["vx", "vy", "d63"], start_s + 1.0, 1e-3, 1000)


def filtered(frequency_hz: float, config: WorldConfig) -> complex:
    """What the resistor and the capacitor make of a frequency."""
    noise = config.noise.x
    return 1 / (1 + 2j * math.pi * frequency_hz * noise.filter_ohm * noise.filter_farad)


def followed(frequency_hz: float, config: WorldConfig) -> complex:
    """What the servo loop makes of it."""
    ratio = frequency_hz / config.positioner.servo_hz
    return 1 / (1 - ratio**2 + 2j * config.positioner.damping_fraction * ratio)


@pytest.mark.parametrize("frequency_hz", [2.0, 10.0, 40.0])
def test_the_acceleration_comes_through_the_filter_in_amplitude_and_phase(frequency_hz: float) -> None:
    world = World(QUIET, seed=1)
    volts = shaken(world, frequency_hz=frequency_hz)
    found = component(volts[:, 0], frequency_hz, 1000.0, 1.0)
    place = -SWING_UM * followed(frequency_hz, QUIET)  # starts at its lowest: -cos
    acceleration_g = -((2 * math.pi * frequency_hz) ** 2) * 1e-6 * place / GRAVITY
    volts_per_g = world.config.sensor.x.plates.sensitivity_v_per_g
    expected = volts_per_g * acceleration_g * filtered(frequency_hz, QUIET)
    assert abs(found) == pytest.approx(abs(expected), rel=3e-4)
    assert np.angle(found / expected) == pytest.approx(0.0, abs=2e-4)
    assert np.ptp(volts[:, 1]) < 1e-6


def test_the_paper_s_pose_shakes_a_horizontal_x(silent: WorldConfig) -> None:
    """alpha = +45, beta = +90: 118.4 mm/s^2 on x, and nearly nothing on y (Ang V)."""
    world = World(silent, seed=1)
    world.move_stage("alpha", Trajectory(0.0, 0.0, 45.0, 40.0, 80.0))
    world.move_stage("beta", Trajectory(0.0, 0.0, 90.0, 40.0, 80.0))
    volts = shaken(world)
    x, y = (abs(component(volts[:, k], HZ, 1000.0, 0.0)) for k in range(2))
    expected = 0.1184 / GRAVITY * abs(filtered(HZ, silent) * followed(HZ, silent))
    assert x == pytest.approx(expected, rel=0.05)  # of this sensor, with its own scale factor and friction
    assert y < 0.05 * x
    assert abs(volts[:, 0].mean() - 2.5) < 0.1


@pytest.mark.parametrize(("axis", "mount_deg", "seen"), [("x", 90.0, 1), ("y", 0.0, 1), ("y", 90.0, 0)])
def test_which_axis_feels_it_hangs_on_the_mount(axis: str, mount_deg: float, seen: int) -> None:
    world = World(QUIET, seed=1)
    world.mount_sensor(mount_deg=mount_deg)
    volts = shaken(world, axis)
    assert np.ptp(volts[:, seen]) > 0.01
    assert np.ptp(volts[:, 1 - seen]) < 1e-6


def test_the_displacement_sensor_sees_the_carriage() -> None:
    volts = shaken(World(QUIET, seed=1))[:, 2]
    gap_um = CalibrationCurve.from_file(SIMULATED).displacement_um(volts)
    found = component(gap_um, HZ, 1000.0, 1.0 + 2 * QUIET.converter.skew_s)  # third channel of the scan
    expected = -SWING_UM * followed(HZ, QUIET)
    assert gap_um.mean() == pytest.approx(QUIET.d63.standoff_um + 50.0, abs=0.02)
    assert abs(found) == pytest.approx(abs(expected), rel=1e-3)
    assert np.angle(found / expected) == pytest.approx(0.0, abs=1e-3)


def test_the_displacement_sensor_is_noisy() -> None:
    volts = World(WorldConfig.ideal(), seed=1).adc_volts(["d63"], 0.0, 1e-3, 20_000)[:, 0]
    assert volts.std() == pytest.approx(WorldConfig.ideal().d63.noise_v, rel=0.02)


def test_nothing_is_felt_before_the_command() -> None:
    """However long ago the output was last looked at: 60 ms after a tick it has felt 10 us of it."""
    before = World(QUIET, seed=1).adc_volts(["vx"], 5.16, 1e-3, 1)[0, 0]
    world = World(QUIET, seed=1)
    world.advance(5.16)
    world.move_positioner("x", hold_command(20.0, 5.16))  # a jump, that begins with more than 1 g
    assert world.adc_volts(["vx"], 5.16001, 1e-3, 1)[0, 0] == pytest.approx(before, abs=2e-3)


def test_after_it_has_settled_it_costs_nothing_and_is_as_before() -> None:
    world = World(QUIET, seed=1)
    before = world.adc_volts(["vx", "vy"], 5.0, 1e-3, 1)
    world.move_positioner("x", sine(5.0))
    world.advance(6.03)
    rest_s = world.move_positioner("x", hold_command(float(world.positioner_um("x")[0]), 6.03))
    assert rest_s < 6.1
    after = world.adc_volts(["vx", "vy"], 8.0, 1e-3, 1)
    assert after == pytest.approx(before, abs=1e-12)
    assert np.ptp(world.positioner_um("x", np.linspace(rest_s, 8.0, 100))) < 1e-6


@pytest.mark.parametrize("sizes", [[1000] * 2, [1] * 10 + [1990], [170] * 11 + [130]])
def test_samples_do_not_depend_on_how_time_is_cut(sizes: list[int]) -> None:
    inputs, worlds = ["vx", "vy", "d63", "supply"], [World(WorldConfig.adxl203(), seed=5) for _ in range(2)]
    for world in worlds:
        world.advance(1.0)
        world.move_positioner("x", sine(1.0))
    whole = worlds[0].adc_volts(inputs, 1.0, 1e-3, 2000)
    starts = 1.0 + 1e-3 * np.cumsum([0, *sizes[:-1]])
    blocks = [worlds[1].adc_volts(inputs, start, 1e-3, n) for start, n in zip(starts, sizes, strict=True)]
    assert np.array_equal(np.concatenate(blocks), whole)


def test_a_restored_world_swings_on_sample_for_sample() -> None:
    world = World(WorldConfig.adxl203(), seed=5)
    world.advance(1.0)
    world.move_positioner("x", sine(1.0))
    world.adc_volts(["vx", "d63"], 1.0, 1e-3, 123)
    kept = json.dumps(world.state())
    other = World(WorldConfig.adxl203(), seed=5)
    other.restore(json.loads(kept))
    assert json.dumps(other.state()) == kept
    first, second = (each.adc_volts(["vx", "d63"], 2.0, 1e-3, 500) for each in (world, other))
    assert np.array_equal(first, second)
    assert np.array_equal(world.positioner_um("x"), other.positioner_um("x"))


def test_axes_have_noise_of_their_own() -> None:
    world = World(WorldConfig.adxl203(), seed=5)
    x, y = (world.positioner_um(axis, np.arange(100) * 1e-3) for axis in "xy")
    assert abs(np.corrcoef(x, y)[0, 1]) < 0.4
    with pytest.raises(UnknownInput, match=r"no axis of the positioner 'u'"):
        world.positioner_um("u")
