from __future__ import annotations

import json

import numpy as np
import pytest

from drivers.world.config import WorldConfig
from drivers.world.errors import BadSetting, TimeReversal, UnknownInput
from drivers.world.stage import Trajectory, at_rest
from drivers.world.world import World

INPUTS = ("vx", "vy", "supply", "thermistor", "ground", "vz")


def turning(seed: int = 5) -> World:
    """A noisy world with both stages on their way."""
    world = World(WorldConfig.adxl203(), seed)
    world.move_stage("alpha", Trajectory(0.0, 0.0, 90.0, 40.0, 80.0))
    world.move_stage("beta", Trajectory(0.5, 0.0, 30.0, 20.0, 40.0))
    return world


def test_the_seed_decides_every_sample() -> None:
    first, again, other = (turning(seed).adc_volts(INPUTS, 0.0, 1e-3, 500) for seed in (5, 5, 6))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("sizes", [[1000] * 5, [1] * 20 + [4980], [170] * 29 + [70]])
def test_samples_do_not_depend_on_how_time_is_cut(sizes: list[int]) -> None:
    whole, cut = turning().adc_volts(INPUTS, 0.0, 1e-3, 5000), turning()
    starts = np.cumsum([0, *sizes[:-1]])
    blocks = [cut.adc_volts(INPUTS, i * 1e-3, 1e-3, n) for i, n in zip(starts, sizes, strict=True)]
    assert np.array_equal(np.concatenate(blocks), whole)


def test_waiting_in_pieces_is_waiting() -> None:
    one, many = turning(), turning()
    one.advance(7.0)
    for t in np.linspace(0, 7, 113):
        many.advance(t)
    assert np.array_equal(one.adc_volts(INPUTS, 7.0, 1e-3, 100), many.adc_volts(INPUTS, 7.0, 1e-3, 100))


def test_a_restored_world_continues_sample_for_sample() -> None:
    world = turning()
    world.oven_set(40.0, running=True)
    world.adc_volts(INPUTS, 0.0, 1e-3, 1234)
    kept = json.dumps(world.state())
    other = World(WorldConfig.adxl203(), seed=5)
    other.restore(json.loads(kept))
    assert json.dumps(other.state()) == kept
    for each in (world, other):
        each.advance(30.0)
        each.move_stage("beta", Trajectory(30.0, 30.0, 90.0, 20.0, 40.0))
    assert np.array_equal(world.adc_volts(INPUTS, 31.0, 1e-3, 2000), other.adc_volts(INPUTS, 31.0, 1e-3, 2000))
    assert world.thermometer_c() == other.thermometer_c()


def test_a_state_of_another_version_is_refused() -> None:
    world = turning()
    kept = world.state()
    kept["world"]["phlogiston"] = 1.0
    with pytest.raises(BadSetting, match="phlogiston"):
        world.restore(kept)


def test_time_ends_at_the_last_scan_and_does_not_run_back() -> None:
    world = turning()
    world.adc_volts(["vx"], 1.0, 1e-3, 11)
    assert world.now_s == pytest.approx(1.01)
    with pytest.raises(TimeReversal, match=r"1\.01"):
        world.advance(1.0)
    with pytest.raises(TimeReversal):
        world.adc_volts(["vx"], 0.5, 1e-3, 1)


def test_a_stream_of_no_scans_takes_no_time() -> None:
    world = turning()
    assert world.adc_volts(["vx", "vy"], 1.0, 1e-3, 0).shape == (0, 2)
    assert world.now_s == 0.0


def test_unknown_names_are_refused_with_the_nearest() -> None:
    with pytest.raises(UnknownInput, match=r"'vxx'.*'vx'"):
        turning().adc_volts(["vxx"], 0.0, 1e-3, 1)
    with pytest.raises(UnknownInput, match="'beta'"):
        turning().motor_angle_deg("bta")


def test_the_motor_follows_its_trajectory_and_stops() -> None:
    world, move = turning(), Trajectory(0.0, 0.0, 90.0, 40.0, 80.0)
    world.advance(1.0)
    assert world.motor_angle_deg("alpha") == pytest.approx(move.angle_deg(1.0))
    world.move_stage("alpha", move.stopped(1.0))
    world.advance(10.0)
    assert world.motor_angle_deg("alpha") == pytest.approx(move.stopped(1.0).angle_deg(10.0))


def test_channels_are_sampled_in_turn() -> None:
    config = WorldConfig.ideal().changed({"noise": {"white_v": 0.0, "hum_v": 0.1}, "converter": {"skew_s": 1e-3}})
    volts = World(config, seed=1).adc_volts(["vx", "vx", "vx"], 0.0, 5e-3, 100)
    late = World(config, seed=1).adc_volts(["vx"], 0.0, 1e-3, 500)[:, 0].reshape(100, 5)
    assert volts == pytest.approx(late[:, :3])


def test_the_sensor_follows_its_mount() -> None:
    world = World(WorldConfig.ideal().changed({"noise": {"white_v": 0.0}}), seed=1)
    world.move_stage("alpha", Trajectory(0.0, 0.0, 90.0, 100.0, 1000.0))
    upright = world.adc_volts(["vx", "vy"], 5.0, 1e-3, 1)[0]
    world.mount_sensor(mount_deg=180.0)
    turned = world.adc_volts(["vx", "vy"], 6.0, 1e-3, 1)[0]
    x = world.config.sensor.x.plates
    assert upright[0] == pytest.approx(x.zero_g_v + x.sensitivity_v_per_g)
    assert turned[0] == pytest.approx(x.zero_g_v - x.sensitivity_v_per_g)
    assert turned[1] == pytest.approx(upright[1])


def test_the_thermistor_tells_the_temperature() -> None:
    world = World(WorldConfig.ideal().changed({"heat": {"ambient_c": 25.0}}), seed=1)
    assert world.adc_volts(["thermistor"], 0.0, 1e-3, 1)[0, 0] == pytest.approx(2.5)


def test_the_converter_bows_and_adds_noise() -> None:
    world = World(WorldConfig.ideal().changed({"converter": {"bow_v": 0.02, "noise_v": 1e-3}}), seed=1)
    ground = world.adc_volts(["ground"], 0.0, 1e-3, 20_000)[:, 0]
    assert ground.mean() == pytest.approx(0.02, abs=1e-4)
    assert ground.std() == pytest.approx(1e-3, rel=0.05)
    supply = world.adc_volts(["supply"], 30.0, 1e-3, 20_000)[:, 0]
    assert supply.mean() == pytest.approx(5.0 + 0.02 * 0.75, abs=1e-4)


@pytest.mark.parametrize(("alpha_deg", "along"), [(0.0, 1.0), (90.0, 0.0), (180.0, -1.0), (-60.0, 0.5)])
def test_the_third_axis_senses_the_specific_force_along_the_normal_of_the_table(alpha_deg: float, along: float) -> None:
    world = World(WorldConfig.ideal().changed({"spread": {"zero_g_v": 0.0, "sensitivity_fraction": 0.0}}), 1)
    world.move_stage("alpha", at_rest(alpha_deg))
    world.advance(1.0)
    assert world.sensed(["az"], 1.0, 1e-3, 2000).mean() == pytest.approx(along, abs=2e-4)
    world.mount_sensor(0.0, 1)
    world.advance(4.0)
    assert world.sensed(["az"], 4.0, 1e-3, 2000).mean() == pytest.approx(-along, abs=2e-4)
