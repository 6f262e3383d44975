"""Sensors on one table share the rig and its room, and nothing else."""

import json

import numpy as np
import pytest

from drivers.world.batch import Batch
from drivers.world.config import WorldConfig
from drivers.world.errors import BadSetting, UnknownInput
from drivers.world.stage import Trajectory
from drivers.world.world import World

CONFIG = WorldConfig.adxl203().changed({"spread": {"sensitivity_fraction": 0.02}})
INPUTS = ("a.vx", "a.vy", "b.vx", "b.vy", "supply")


def batch(seed: int = 1, **own: dict[str, object]) -> Batch:
    return Batch(CONFIG, seed, {"a": {}, "b": own})


def test_the_first_sensor_is_the_one_of_a_table_with_a_single_one() -> None:
    alone, together = World(CONFIG, 1), batch()
    for each in (alone, together):
        each.move_stage("alpha", Trajectory(0.0, 0.0, 90.0, 30.0, 60.0))
    expected = alone.adc_volts(("vx", "vy"), 10.0, 1e-3, 50)
    np.testing.assert_array_equal(together.adc_volts(("a.vx", "a.vy"), 10.0, 1e-3, 50), expected)


def test_each_sensor_has_its_own_trim_and_its_own_noise() -> None:
    volts = batch().adc_volts(INPUTS, 1.0, 1e-3, 4000)
    a, b = volts[:, 0], volts[:, 2]
    assert abs(a.mean() - b.mean()) > 1e-3
    assert abs(np.corrcoef(a, b)[0, 1]) < 0.3
    other = batch(sensor={"package": {"turn_z_deg": 5.0}}).adc_volts(INPUTS, 1.0, 1e-3, 4000)
    np.testing.assert_array_equal(other[:, 0], a)


def test_room_and_supply_are_the_same_for_all() -> None:
    worlds = [World(CONFIG, 1, place) for place in range(3)]
    for world in worlds:
        world.oven_set(50.0, True)
        world.advance(3000.0)
    shared = [(w.thermometer_c(), w.level_deg(), w.adc_volts(["supply"], 3000.0, 1e-3, 1)[0, 0]) for w in worlds]
    assert shared[0][0] == shared[1][0] == shared[2][0]
    assert shared[0][1] == shared[1][1] == shared[2][1]
    assert np.ptp([s[2] for s in shared]) < 6 * CONFIG.converter.noise_v  # read by noisy converters


def test_outputs_are_sampled_in_turn_wherever_their_sensor_stands() -> None:
    config = WorldConfig.ideal().changed({"noise": {"white_v": 0.0}, "converter": {"skew_s": 0.01}})
    outputs = {}
    for inputs in (("a.vx", "b.vx"), ("b.vx", "a.vx")):
        world = Batch(config, 1, {"a": {}, "b": {}})
        world.move_stage("alpha", Trajectory(0.0, 0.0, 90.0, 30.0, 60.0))
        volts = world.adc_volts(inputs, 1.5, 0.05, 10)
        outputs |= {(name, k): volts[:, k] for k, name in enumerate(inputs)}
    np.testing.assert_array_equal(outputs["a.vx", 0] < outputs["a.vx", 1], np.full(10, True))  # alpha rises
    np.testing.assert_array_equal(outputs["b.vx", 0] < outputs["b.vx", 1], np.full(10, True))


def test_it_continues_sample_for_sample() -> None:
    first, again = batch(), batch()
    first.adc_volts(INPUTS, 1.0, 1e-3, 100)
    kept = json.loads(json.dumps(first.state()))
    expected = first.adc_volts(INPUTS, 2.0, 1e-3, 100)
    again.restore(kept)
    np.testing.assert_array_equal(again.adc_volts(INPUTS, 2.0, 1e-3, 100), expected)


def test_what_all_share_cannot_be_a_sensors_own() -> None:
    with pytest.raises(BadSetting, match="heat of sensor b's world is shared by all"):
        batch(heat={"ambient_c": 30.0})


def test_an_input_of_no_sensor_is_refused_with_the_nearest() -> None:
    with pytest.raises(UnknownInput, match=r"no sensor 'bb' for the input 'bb\.vx'\. Did you mean 'b'"):
        batch().adc_volts(("bb.vx",), 0.0, 1e-3, 1)
