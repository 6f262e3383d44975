"""The oven's staircase, and what a run that goes on does."""

from __future__ import annotations

import pytest

from calibrations.analyses.tumble import bias_coefficients, estimate_tumbles, scale_coefficients
from drivers.world.config import WorldConfig
from drivers.world.world import World
from procedures.errors import SafetyLimit, SettingError
from procedures.session import Limits
from procedures.temperature_cycle import staircase, temperature_cycle
from tests.procedures.bench import Oven, session

NM_PER_G = 8.2124  # a mass on springs of 5500 Hz
EXACT = {"imperfection_fraction": 0.0, "sensitivity_fraction": 0.0}
BENT = {"stress_pm_per_k": 8.0, "stiffening_ppm_per_k": -200.0}


def world(play_k: float) -> World:
    """A perfect rig whose package bends with its temperature, through glue with play."""
    springs = {axis: {"springs": BENT} for axis in "xy"}
    changes = {"sensor": springs, "heat": {"glue_play_k": play_k}, "spread": EXACT}
    return World(WorldConfig.ideal().changed(changes), seed=1)


def test_the_staircase_goes_up_and_back() -> None:
    steps = staircase((50.0, 35.0, 65.0), 1)
    assert [c for _, c in steps] == [35, 50, 65, 50, 35]
    assert [path.split()[0] for path, _ in steps] == ["up", "up", "up", "down", "down"]
    assert len(dict(staircase((35.0, 65.0), 2))) == 6


@pytest.mark.parametrize(("temperatures_c", "cycles"), [((35.0,), 1), ((35.0, 35.0), 1), ((35.0, 50.0), 0)])
def test_a_staircase_needs_two_temperatures(temperatures_c: tuple[float, ...], cycles: int) -> None:
    with pytest.raises(SettingError, match=r"at least two different temperatures_c|cycles is 0; give 1"):
        staircase(temperatures_c, cycles)


def test_slopes_and_hysteresis_are_those_of_the_package() -> None:
    rig, book = session(world(play_k=1.5))
    temperature_cycle(rig, soak_s=7200.0, dwell_s=1.0)
    assert len(book.dwells) == 5 * 8
    per_k_v = 8.0e-3 / NM_PER_G
    for axis in "xy":
        steps = estimate_tumbles(book.table(), axis)
        bias, scale = bias_coefficients(steps), scale_coefficients(steps)
        assert bias.slope[0] == pytest.approx(per_k_v, rel=0.03)
        assert -1.5 * per_k_v < bias.hysteresis[0] < -0.5 * per_k_v  # the oven's overshoot closes part of the loop
        assert abs(bias.hysteresis[0]) > 4 * bias.hysteresis[1]
        assert scale.slope[0] == pytest.approx(200e-6, rel=0.1)
        assert abs(scale.hysteresis[0]) < max(4 * scale.hysteresis[1], 2e-4)


def test_the_oven_gets_its_set_point_before_every_pose_and_is_off_at_the_end() -> None:
    rig, book = session(world(0.0))
    temperature_cycle(rig, temperatures_c=(35.0, 40.0), soak_s=7200.0, dwell_s=0.1)
    assert isinstance(rig.oven, Oven)
    assert rig.oven.told == [35.0, True] * 8 + [40.0, True] * 8 + [35.0, True] * 8 + [False]
    assert {d.pose.path for d in book.dwells} == {"up 35 cycle 1", "up 40 cycle 1", "down 35 cycle 1"}


def test_an_oven_that_has_cooled_in_an_interruption_is_soaked_again() -> None:
    whole, book = session(world(0.0))
    temperature_cycle(whole, temperatures_c=(35.0, 40.0), soak_s=7200.0, dwell_s=0.1)
    cold, rest = session(world(0.0), dwells=book.dwells[:3])
    temperature_cycle(cold, temperatures_c=(35.0, 40.0), soak_s=7200.0, dwell_s=0.1)
    assert [d.pose for d in rest.dwells] == [d.pose for d in book.dwells]
    assert rest.dwells[3].temperature_c == pytest.approx(35.0, abs=0.5)


def test_too_hot_a_sensor_stops_it_during_the_soak() -> None:
    rig, book = session(world(0.0), limits=Limits(temperature_c=(-20.0, 40.0)))
    with pytest.raises(SafetyLimit, match="outside the limits"):
        temperature_cycle(rig, temperatures_c=(35.0, 60.0), soak_s=7200.0, dwell_s=0.1)
    assert len(book.dwells) == 8
