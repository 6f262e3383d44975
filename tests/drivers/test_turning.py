"""A stage that turns at a constant rate: to an end by itself, or on and on until it is stopped."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from drivers.clock import SimulatedClock
from drivers.errors import LimitError, NotSettled, StageAlarm
from drivers.manual_stage import driver as manual_stage
from drivers.oriental_az import driver as oriental_az
from drivers.oriental_az import twin as oriental_az_twin
from drivers.oriental_az.driver import RotaryStage, Settings
from drivers.transport import Links
from drivers.transport.faults import Fault, faults_of
from tests.drivers.conftest import SmallWorld

ENDLESS = Settings(limits_deg=(-math.inf, math.inf), communication_timeout_s=1.0)
Stages = Callable[[Settings], RotaryStage]


@pytest.fixture
def stage(small_world: SmallWorld) -> Iterator[Callable[..., RotaryStage]]:
    """A homed stage on the simulated drive, with faults."""
    clock, servers = SimulatedClock(), []

    def make(settings: Settings, *faults: Fault) -> RotaryStage:
        server = oriental_az_twin.serve(small_world, {"beta": (1, settings)})
        servers.append(server)
        server.afflict("beta", faults_of("oriental_az", faults))
        clock.attach(server)
        made = oriental_az.connect(server.addresses["beta"], links, settings, "beta")
        made.home()
        return made

    links = Links(clock)
    yield make
    links.close()
    for server in servers:
        server.close()


def passes(stage: RotaryStage, world: SmallWorld, seconds: float) -> float:
    """Degrees that go by in so many seconds."""
    before = stage.angle_deg(), stage._clock.now()
    stage._clock.sleep(seconds)
    world.advance(stage._clock.now())
    return (stage.angle_deg() - before[0]) / (stage._clock.now() - before[1])


@pytest.mark.parametrize(("settings", "kind"), [(Settings(), "limited"), (ENDLESS, "endless")])
@pytest.mark.parametrize("way", [1, -1])
def test_it_has_its_rate_from_the_first_angle_to_the_last(
    stage: Stages, small_world: SmallWorld, settings: Settings, kind: str, way: int
) -> None:
    beta = stage(dataclasses.replace(settings, communication_timeout_s=2.0))
    with beta.turning(40.0, -90.0 * way, 90.0 * way) as turn:
        assert turn.rate_deg_s == pytest.approx(40.0 * way)
        assert way * beta.angle_deg() == pytest.approx(-90.0, abs=0.5)
        for _ in range(9):
            assert passes(beta, small_world, 0.45) == pytest.approx(40.0 * way, rel=2e-3)
            turn.require()
        assert way * beta.angle_deg() >= 90.0 * 0.8
    beta.require_steady()
    assert way * beta.angle_deg() > 90.0
    beta.move_to(0.0)


def test_a_rate_is_a_whole_number_of_steps_a_second(stage: Stages) -> None:
    beta = stage(Settings(steps_per_turn=18000))
    with beta.turning(33.333, 0.0, 90.0) as turn:
        assert turn.rate_deg_s == pytest.approx(33.34)


@pytest.mark.parametrize(
    ("settings", "rate", "words"),
    [
        (Settings(), 1201.0, "cannot turn at 1201 deg/s; its limit is 1200 deg/s; nothing was sent"),
        (Settings(), 0.0, "cannot turn at 0 deg/s"),
        (Settings(), 200.0, r"outside its limits -400 .. 400 deg; nothing was sent. Ask for a slower"),
        (
            dataclasses.replace(ENDLESS, communication_timeout_s=0.0),
            20.0,
            "would not stop if this program crashes",
        ),
    ],
)
def test_what_it_cannot_do_is_refused_before_a_word_on_the_wire(
    stage: Stages, settings: Settings, rate: float, words: str
) -> None:
    beta = stage(settings)
    before = beta._clock.now()
    with pytest.raises(LimitError, match=words), beta.turning(rate, -180.0, 180.0):
        raise AssertionError
    assert beta._clock.now() == before


@pytest.mark.parametrize("settings", [Settings(), ENDLESS])
@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_whatever_ends_it_it_stands(stage: Stages, small_world: SmallWorld, settings: Settings, error: Any) -> None:
    beta = stage(settings)
    with pytest.raises(error), beta.turning(20.0, -90.0, 90.0):
        raise error
    assert passes(beta, small_world, 1.0) == 0.0
    assert beta.angle_deg() < 90.0


def test_a_limited_turn_ends_by_itself_though_nobody_speaks_any_more(stage: Stages, small_world: SmallWorld) -> None:
    beta = stage(Settings())
    dead = beta.turning(20.0, -90.0, 90.0)
    dead.__enter__()  # and the program dies here
    small_world.advance(small_world.now_s + 60.0)
    assert small_world.motor_angle_deg("beta") == pytest.approx(90.0 + 20.0 * 0.5 + 20.0**2 / 120.0, abs=0.02)


def test_an_endless_turn_is_ended_by_the_drive_where_nobody_speaks_any_more(
    stage: Stages, small_world: SmallWorld
) -> None:
    beta = stage(ENDLESS)
    dead = beta.turning(20.0, -90.0, 90.0)
    dead.__enter__()
    beta._clock.sleep(60.0)
    with pytest.raises(StageAlarm, match="alarm 85, RS-485 communication time-out"):
        beta.look()
    stood = small_world.plans["beta"]
    assert stood.rate_deg_s(beta._clock.now()) == 0.0
    assert stood.angle_deg(beta._clock.now()) < -90.0 + 20.0 * 2


def test_a_stage_that_does_not_turn_is_found(stage: Callable[..., RotaryStage]) -> None:
    beta = stage(Settings(), Fault(what="stuck", at_s=2.0))
    beta._clock.sleep(2.0)
    with pytest.raises(NotSettled, match=r"stands at|turns at 0.000 deg/s instead of 20.000"):  # noqa: SIM117
        with beta.turning(20.0, 4.0 + 20**2 / 120, 90.0) as turn:
            turn.require()


def test_no_hand_turns_at_a_constant_rate() -> None:
    with pytest.raises(LimitError, match="alpha: a person turns this stage"):
        manual_stage.Settings().way_of_turn("alpha", 20.0, 0.0, 90.0)
