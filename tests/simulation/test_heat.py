from __future__ import annotations

from math import exp

import numpy as np
import pytest

from drivers.world.config import WorldConfig
from drivers.world.kernel import step_wander
from drivers.world.world import World


def world(**heat: float) -> World:
    return World(WorldConfig.ideal().changed({"heat": heat}), seed=1)


def test_a_steady_room_keeps_its_temperature() -> None:
    steady = world(ambient_c=20.0)
    steady.advance(1000.0)
    assert steady.thermometer_c() == pytest.approx(20.0)


def test_the_board_warms_with_its_time_constant_and_the_thermocouple_is_off() -> None:
    cold = world(ambient_c=20.0, board_rise_k=6.0, board_rise_s=3600.0, powered_for_s=0.0, thermocouple_offset_k=0.5)
    assert cold.thermometer_c() == pytest.approx(20.5)
    cold.advance(3600.0)
    assert cold.thermometer_c() == pytest.approx(20.5 + 6 * (1 - exp(-1)))


def test_a_warm_start_has_warmed_up() -> None:
    assert world(ambient_c=20.0, board_rise_k=6.0).thermometer_c() == pytest.approx(26.0, abs=0.01)


def test_power_off_cools_and_silences_the_output() -> None:
    warm = world(ambient_c=20.0, board_rise_k=6.0, board_rise_s=600.0)
    warm.power(False)
    warm.advance(600.0)
    assert warm.thermometer_c() == pytest.approx(20 + 6 * exp(-1), abs=0.01)
    assert abs(warm.adc_volts(["vx", "supply"], 600.0, 1e-3, 50)).max() < 0.005
    assert warm.powered_s() == 0.0
    warm.power(True)
    warm.advance(warm.now_s + 10.0)
    assert warm.powered_s() == pytest.approx(10.0)
    assert warm.adc_volts(["supply"], warm.now_s, 1e-3, 1)[0, 0] == 5.0


def test_the_oven_reaches_and_holds_its_set_point() -> None:
    oven = world(ambient_c=22.0, thermocouple_lag_s=8.0)
    oven.oven_set(60.0, running=True)
    readings = []
    for minute in range(1, 241):
        oven.advance(60.0 * minute)
        readings.append(oven.thermometer_c())
    assert max(readings) < 70.0
    assert np.ptp(readings[-30:]) < 0.2
    assert readings[-1] == pytest.approx(60.0, abs=0.1)
    oven.oven_set(60.0, running=False)
    oven.advance(oven.now_s + 4 * 3600.0)
    assert oven.thermometer_c() == pytest.approx(22.0, abs=0.1)


def test_the_thermocouple_lags_behind_a_ramp() -> None:
    ramps = [world(ambient_ramp_k_per_h=36.0, thermocouple_lag_s=lag) for lag in (0.0, 20.0)]
    for each in ramps:
        each.advance(3600.0)
    assert ramps[0].thermometer_c() - ramps[1].thermometer_c() == pytest.approx(0.2, abs=0.01)


def test_a_wander_has_its_rms_and_correlation() -> None:
    random = np.random.default_rng(5)
    values = [0.0]
    for normal in random.standard_normal(50_000):
        values.append(step_wander(values[-1], 2.0, 1.0, 0.1, normal))
    series = np.array(values[100:])
    assert series.std() == pytest.approx(2.0, rel=0.05)
    assert np.corrcoef(series[:-10], series[10:])[0, 1] == pytest.approx(exp(-1), abs=0.05)


def test_stress_follows_the_temperature_with_play_if_the_glue_creeps() -> None:
    room = {"ambient_cycle_k": 2.0, "ambient_cycle_s": 2000.0, "chamber_lag_s": 0.0, "body_lag_s": 0.0}
    outputs = {}
    for play in (0.0, 1.0):
        config = WorldConfig.ideal().changed(
            {"heat": {**room, "glue_play_k": play}, "sensor": {"x": {"springs": {"stress_pm_per_k": 8.0}}}}
        )
        rig = World(config, seed=1)
        rig.advance(2000.0)
        outputs[play] = rig.dwell_mean(np.zeros(200), 0.0, dwell_s=10.0, settle_s=0.0, noise_free=True)
    plain, creeping = outputs[0.0], outputs[1.0]
    slope = np.polyfit(plain["temperature_c"], plain["vx_v"], 1)
    assert np.std(plain["vx_v"] - np.polyval(slope, plain["temperature_c"])) < 1e-6
    assert np.std(creeping["vx_v"] - np.polyval(slope, creeping["temperature_c"])) > 1e-4
