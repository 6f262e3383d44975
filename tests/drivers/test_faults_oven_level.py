"""An oven and a level that misbehave: what their drivers make of it, and that a sound one is left in peace."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from drivers.clock import SimulatedClock
from drivers.dpg2 import driver as dpg2
from drivers.dpg2 import twin as dpg2_twin
from drivers.errors import InstrumentError, OverTemperature, SensorFault
from drivers.omega_cn7500 import driver as omega_cn7500
from drivers.omega_cn7500 import twin as omega_cn7500_twin
from drivers.transport import Links
from drivers.transport.faults import Fault, faults_of
from drivers.world.config import WorldConfig
from drivers.world.world import World


@pytest.fixture
def world() -> World:
    return World(WorldConfig.from_mapping({"preset": "adxl203"}), 1)


@pytest.fixture
def oven(world: World, clock: SimulatedClock) -> Iterator[Callable[..., omega_cn7500.Oven]]:
    """The driver on its twin in the physical world, with faults."""
    links, settings = Links(clock), omega_cn7500.Settings()
    server = omega_cn7500_twin.serve(world, {"oven": (1, settings)})
    clock.attach(server)

    def make(*faults: Fault) -> omega_cn7500.Oven:
        server.afflict("oven", faults_of("omega_cn7500", faults))
        return omega_cn7500.connect(server.addresses["oven"], links, settings, "oven")

    yield make
    links.close()
    server.close()


def heating(oven: omega_cn7500.Oven, clock: SimulatedClock, set_c: float, every_s: float, for_s: float) -> list[float]:
    oven.set_temperature(set_c)
    oven.run(True)
    shown = []
    while clock.now() < for_s:
        clock.sleep(every_s)
        shown.append(oven.temperature_c())
    return shown


def test_a_sound_oven_is_left_in_peace(oven: Callable[..., Any], clock: SimulatedClock) -> None:
    shown = heating(oven(), clock, 60.0, 60.0, 7200.0)
    assert shown[-1] == pytest.approx(60.0, abs=0.5)  # and stands still there, for long


def test_one_that_need_not_heat_may_stand_still(oven: Callable[..., Any], clock: SimulatedClock) -> None:
    still = oven()
    for _ in range(100):
        clock.sleep(60.0)
        still.temperature_c()


def test_a_new_set_point_after_an_idle_time_is_no_fault(oven: Callable[..., Any], clock: SimulatedClock) -> None:
    idle = oven()
    idle.set_temperature(idle.temperature_c())
    idle.run(True)
    shown_c = idle.temperature_c()
    clock.sleep(400.0)
    idle.set_temperature(60.0)
    assert idle.temperature_c() == pytest.approx(shown_c, abs=0.1)


def test_an_oven_that_is_switched_on_after_an_idle_time_is_no_fault(
    oven: Callable[..., Any], clock: SimulatedClock
) -> None:
    idle = oven()
    idle.set_temperature(60.0)
    shown_c = idle.temperature_c()
    clock.sleep(400.0)
    idle.run(True)
    assert idle.temperature_c() == pytest.approx(shown_c, abs=0.1)


def test_a_repeated_set_point_hides_no_stuck_thermometer(oven: Callable[..., Any], clock: SimulatedClock) -> None:
    stuck = oven(Fault("stale", at_s=100.0))

    def repeat() -> None:
        for _ in range(30):
            heating(stuck, clock, 60.0, 20.0, clock.now() + 20.0)

    with pytest.raises(SensorFault, match="while approaching 60 C"):
        repeat()
    assert clock.now() < 500.0


def test_a_thermometer_that_sticks_at_a_set_point_is_stuck_since_its_first_equal_reading(
    oven: Callable[..., Any], clock: SimulatedClock
) -> None:
    """Near the set point 32 C a constant temperature is no fault; on the way to 60 C it is. All between is wrong."""
    stuck = oven(Fault("stale", at_s=300.0))
    heating(stuck, clock, 32.0, 20.0, 1200.0)
    assert abs(stuck.temperature_c() - 32.0) < 5.0
    with pytest.raises(SensorFault, match="while approaching 60 C") as caught:
        heating(stuck, clock, 60.0, 20.0, 7200.0)
    assert caught.value.since_s == pytest.approx(300.0, abs=60.0)


def test_a_thermometer_that_has_stuck_is_found_while_the_heater_follows_it(
    oven: Callable[..., Any], world: World, clock: SimulatedClock
) -> None:
    stuck = oven(Fault("stale", at_s=100.0))
    with pytest.raises(SensorFault, match=r"oven: has shown \d\d\.\d C for 3\d\d s while approaching 60 C. Check the"):
        heating(stuck, clock, 60.0, 20.0, 7200.0)
    assert clock.now() < 500.0
    stuck.run(False)
    world.advance(clock.now() + 3600.0)
    assert world.thermometer_c() < 40.0  # it does not heat on


def test_a_heater_that_runs_away_is_found_above_the_limit(
    oven: Callable[..., Any], world: World, clock: SimulatedClock
) -> None:
    wild = oven(Fault("runaway", at_s=100.0))
    with pytest.raises(
        OverTemperature, match=r"oven: shows 9\d\.\d C, more than 10 K above its limit 85 C. Switch the"
    ):
        heating(wild, clock, 60.0, 10.0, 7200.0)
    hottest_c = world.thermometer_c()
    wild.run(False)
    world.advance(clock.now() + 7200.0)
    assert world.thermometer_c() < hottest_c - 40


def test_a_controller_that_was_without_power_does_not_heat(oven: Callable[..., Any], clock: SimulatedClock) -> None:
    weak = oven(Fault("restart", at_s=100.0))
    heating(weak, clock, 60.0, 10.0, 90.0)
    assert weak.running()
    clock.sleep(60.0)
    assert (weak.running(), weak.set_point_c()) == (False, 25.0)


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("stale", "was received 30 times in a row. Switch the level off and on"),
        ("out-of-range", "x axis is beyond its range"),
    ],
)
def test_a_level_that_shows_nothing_new_or_nothing_at_all(
    world: World, clock: SimulatedClock, what: str, said: str
) -> None:
    links, server = Links(clock), dpg2_twin.serve(world, {"level": (1, dpg2.Settings())})
    clock.attach(server)
    level = dpg2.connect(server.addresses["level"], links, dpg2.Settings(), "level")
    assert level.read().n == 10
    server.afflict("level", faults_of("dpg2", [Fault(what)]))
    with pytest.raises(InstrumentError, match=f"level: .*{said}"):
        level.read()
    links.close()
    server.close()
