"""What keeps a stage safe beside its driver: the drive's own limits, its stop input, its watch over the controller."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest

from drivers.clock import SimulatedClock
from drivers.errors import Interlocked, LimitError, LinkTimeout, NotSettled, StageAlarm
from drivers.oriental_az import driver as oriental_az
from drivers.oriental_az import twin as oriental_az_twin
from drivers.transport import Links
from drivers.transport.faults import Fault, faults_of
from drivers.transport.server import Server

LIMITED = oriental_az.Settings(steps_per_turn=36000, limits_deg=(-90.0, 100.0), own_limits=True)
CARELESS = oriental_az.Settings(steps_per_turn=36000, limits_deg=(-1000.0, 1000.0))
Make = Callable[..., oriental_az.RotaryStage]


@pytest.fixture
def server(small_world: Any, clock: SimulatedClock) -> Iterator[Server]:
    served = oriental_az_twin.serve(small_world, {"alpha": (1, LIMITED)})
    clock.attach(served)
    yield served
    served.close()


@pytest.fixture
def stage(server: Server, clock: SimulatedClock) -> Iterator[Make]:
    """Makes a driver with settings, on the same drive, homed."""
    links = Links(clock)

    def make(settings: oriental_az.Settings = LIMITED) -> oriental_az.RotaryStage:
        made = oriental_az.connect(server.addresses["alpha"], links, settings, "alpha")
        made.home()
        return made

    yield make
    links.close()


def test_a_drive_with_limits_of_its_own_stops_whoever_sends_it_too_far(stage: Make) -> None:
    """The driver's limits are those of its settings; another program's are wider."""
    mine = stage()
    mine.move_to(100.0)
    with pytest.raises(LimitError, match="nothing was sent"):
        mine.start(101.0)
    other = stage(CARELESS)
    other.start(500.0)
    with pytest.raises(StageAlarm, match=r"alarm 67, software overtravel. Turn the stage by hand away from its limit"):
        other.wait()
    assert other.angle_deg() == pytest.approx(100.0, abs=0.01)


def test_without_them_it_goes_wherever_it_is_sent(stage: Make) -> None:
    stage(CARELESS).move_to(200.0)


def test_limits_that_the_drive_does_not_take_are_found_before_the_first_move(
    stage: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    limited = stage()
    monkeypatch.setattr(oriental_az_twin.Drive, "write_words", lambda *_: None)
    with pytest.raises(Interlocked, match=r"has not accepted its limits of -9000 .. 10000 steps: it shows 0 in reg"):
        limited.start(50.0)


@pytest.mark.parametrize(
    ("action", "high", "low", "plausible"),
    [(3, 10000, -9000, True), (0, 0, 0, True), (3, -9000, 10000, False), (77, 10000, -9000, False)],
)
def test_limits_of_the_drive_that_cannot_be_are_shown(
    stage: Make, monkeypatch: pytest.MonkeyPatch, action: int, high: int, low: int, plausible: bool
) -> None:
    limited = stage()
    monkeypatch.setattr(limited._unit, "read_block", lambda *_: [action, high, low])
    assert {check.name: check.ok for check in limited._parameters()}["own limits"] == plausible


@pytest.mark.parametrize(("found_s", "plausible"), [(0.0, True), (0.5, True), (1.0, False)])
def test_a_time_out_of_the_drive_that_nobody_set_is_shown(
    stage: Make, monkeypatch: pytest.MonkeyPatch, found_s: float, plausible: bool
) -> None:
    watched = stage(replace(CARELESS, communication_timeout_s=0.5))
    monkeypatch.setattr(watched._unit, "read", lambda *_: found_s)
    assert {check.name: check.ok for check in watched._parameters()}["time-out"] == plausible


def test_a_stop_input_brakes_the_stage_and_keeps_it_from_starting(
    stage: Make, server: Server, clock: SimulatedClock, small_world: Any
) -> None:
    """As an emergency stop does that the drive itself is wired to."""
    moving = stage()
    server.afflict("alpha", faults_of("oriental_az", [Fault("e-stop", at_s=clock.now() + 1.0, for_s=60.0)]))
    moving.start(90.0)
    with pytest.raises(
        Interlocked, match="alpha: is at rest without an alarm and is not ready to move: its stop input"
    ):
        moving.wait()
    stood_deg = small_world.motor_angle_deg("alpha")
    assert 10.0 < stood_deg < 60.0
    for act in (moving.require_steady, lambda: moving.start(90.0)):
        with pytest.raises(Interlocked, match="Release the emergency stop"):
            act()
    clock.sleep(60.0)
    assert small_world.motor_angle_deg("alpha") == stood_deg, "it does not go on by itself"
    with pytest.raises(NotSettled, match=r"instead of 90.000 deg"):
        moving.require_steady()
    moving.move_to(90.0)
    moving.require_steady()


def test_a_stage_moved_by_another_program_is_not_steady(stage: Make) -> None:
    mine = stage(CARELESS)
    mine.require_steady()  # no command since homing
    mine.move_to(10.0)
    other = stage(CARELESS)
    other.move_to(10.04)
    mine.move_to(10.0)
    mine.require_steady()
    other.move_to(10.06)
    with pytest.raises(NotSettled, match=r"alpha: is at 10.060 deg instead of 10.000 deg, more than 0.05 deg away"):
        mine.require_steady()
    mine.stop()
    mine.require_steady()  # a stop replaces the command


def test_an_alarm_is_seen_by_whoever_looks(stage: Make, server: Server, clock: SimulatedClock) -> None:
    sound = stage()
    sound.look()
    server.afflict("alpha", faults_of("oriental_az", [Fault("alarm", at_s=clock.now(), size=0x10)]))
    with pytest.raises(StageAlarm, match="alarm 10, excessive position deviation"):
        sound.look()


def test_a_stage_that_is_told_to_halt_brakes_while_others_are_told(stage: Make, clock: SimulatedClock) -> None:
    moving = stage()
    moving.start(90.0)
    clock.sleep(1.0)
    asked_s = clock.now()
    moving.halt()
    assert clock.now() - asked_s < 0.02
    clock.sleep(1.0)
    assert moving.angle_deg() < 35.0  # 22.5 when it was told, 7.5 to brake; else 52.5
    moving.stop()


@pytest.mark.parametrize(("start_deg", "end_deg"), [(90.0, 100.0), (40.0, -40.0)])
def test_a_move_takes_as_long_as_its_distance_needs(
    stage: Make, clock: SimulatedClock, start_deg: float, end_deg: float
) -> None:
    mine = stage()
    mine.move_to(start_deg)
    begun_s = clock.now()
    mine.move_to(end_deg)
    assert clock.now() - begun_s == pytest.approx(LIMITED.move_s(abs(end_deg - start_deg)), abs=0.5)


def test_a_stop_whose_answers_were_lost_does_not_hold_the_next_run(server: Server, stage: Make) -> None:
    """The drive has the command and keeps its stop input on: it accepts moves and does not make them."""
    first = stage()
    server.afflict("alpha", faults_of("oriental_az", [Fault("lost-answers")]))
    with pytest.raises(LinkTimeout):
        first.stop()
    server.afflict("alpha", faults_of("oriental_az", []))
    with pytest.raises(NotSettled, match=r"is at 0\.000 deg instead of 60\.000 deg"):
        first.move_to(60.0)
    assert first.release()
    assert not first.release()
    first.move_to(60.0)
