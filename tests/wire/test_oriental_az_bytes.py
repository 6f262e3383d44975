"""The AZ driver's bytes, written out from the layout of the manual's register table; checksums included."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import pytest

from drivers.clock import SimulatedClock
from drivers.errors import Interlocked, LimitError, NotSettled, StageAlarm, StageLost
from drivers.oriental_az import driver as oriental_az
from drivers.oriental_az.driver import RotaryStage, Settings
from drivers.transport import Address, Links

SETTINGS = Settings(
    steps_per_turn=36000, limits_deg=(-90.0, 100.0), speed_deg_s=20.0, acceleration_deg_s2=15.0, settle_deg=0.05
)
ASK_ALARM, NO_ALARM = "01 03 00 80 00 02 C5 E3", "01 03 04 00 00 00 00 FA 33"
ASK_POSITION = "01 03 00 CC 00 02 04 34"
AT_MINUS_4500, AT_8500, AT_8400 = (
    "01 03 04 FF FF EE 6C B7 9A",
    "01 03 04 00 00 21 34 E3 B4",
    "01 03 04 00 00 20 D0 E2 6F",
)
MOVE_TO_8500 = (
    "01 10 00 58 00 10 20 "  # 16 registers from 0058
    "00 00 00 00 "  # data number 0
    "00 00 00 01 "  # absolute positioning
    "00 00 21 34 "  # 8500 steps
    "00 00 07 D0 "  # 2000 Hz
    "00 00 05 DC "  # 1.5 kHz/s
    "00 00 05 DC "  # 1.5 kHz/s
    "00 00 03 E8 "  # 100.0 %
    "00 00 00 01 "  # trigger: all
    "E3 43"
)
TAKEN = "01 10 00 58 00 10 40 16"
ASK_STATUS = "01 03 00 7F 00 03 34 13"
STANDING = "01 03 06 40 20 00 00 00 00 AE 72"  # IN-POS, READY, no alarm
MOVING = "01 03 06 20 00 00 00 00 00 26 15"
BLOCKED = "01 03 06 00 80 00 00 00 30 20 BF"  # ALM, alarm 30
HOMED = "01 03 06 40 30 00 00 00 00 6F B1"  # IN-POS, READY, HOME-END
START = [(ASK_STATUS, HOMED), (ASK_POSITION, AT_MINUS_4500), (MOVE_TO_8500, TAKEN)]
Stages = Callable[[list[tuple[str, str]]], RotaryStage]


@pytest.fixture
def stage(script: Callable[..., Address], links: Links) -> Stages:
    return lambda exchanges: oriental_az.connect(script(exchanges), links, SETTINGS, "alpha")


def test_angle_is_the_feedback_position(stage: Stages) -> None:
    assert stage([(ASK_POSITION, AT_MINUS_4500)]).angle_deg() == -45.0


def test_a_move_is_one_block_and_sleeps_through_its_duration(stage: Stages, clock: SimulatedClock) -> None:
    stage([*START, (ASK_STATUS, HOMED), (ASK_POSITION, AT_8500)]).move_to(85.0)
    assert clock.now() == pytest.approx(130 / 20 + 20 / 15, abs=0.01)  # 130 deg: a trapezoid of speed


def test_where_it_stands_already_it_is_not_sent(stage: Stages) -> None:
    stage([(ASK_STATUS, HOMED), (ASK_POSITION, AT_8500)]).move_to(85.0)


def test_a_move_that_lasts_longer_is_polled(stage: Stages) -> None:
    stage([*START, (ASK_STATUS, MOVING), (ASK_STATUS, HOMED), (ASK_POSITION, AT_8500)]).move_to(85.0)


@pytest.mark.parametrize("angle", [100.01, -90.01, math.inf, math.nan])
def test_outside_its_limits_nothing_is_sent(stage: Stages, angle: float) -> None:
    with pytest.raises(LimitError, match=r"alpha: .* outside its limits -90 .. 100 deg; nothing was sent"):
        stage([]).move_to(angle)


def test_arrival_is_measured_not_assumed(stage: Stages) -> None:
    exchanges = [*START, (ASK_STATUS, HOMED), (ASK_POSITION, AT_8400)]
    with pytest.raises(NotSettled, match=r"alpha: is at 84.000 deg instead of 85.000 deg"):
        stage(exchanges).move_to(85.0)


def test_an_alarm_during_a_move_is_put_into_words(stage: Stages) -> None:
    with pytest.raises(
        StageAlarm, match=r"alarm 30, overload. Remove what blocks the stage.* then reset the alarm"
    ) as raised:
        stage([*START, (ASK_STATUS, BLOCKED)]).move_to(85.0)
    assert raised.value.code == 0x30


def test_with_an_alarm_no_move_is_started(stage: Stages) -> None:
    with pytest.raises(StageAlarm, match=r"alarm 4A, absolute move before the coordinates are set. Home"):
        stage([(ASK_STATUS, "01 03 06 00 80 00 00 00 4A A1 5C")]).move_to(85.0)


def test_without_coordinates_it_is_not_moved_blindly(stage: Stages) -> None:
    with pytest.raises(StageLost, match=r"alpha: the position is unknown, so no move is allowed\. Find out"):
        stage([(ASK_STATUS, STANDING)]).move_to(85.0)


def test_a_stop_holds_the_input_until_the_motor_stands(stage: Stages) -> None:
    on, off = "01 06 00 7D 00 20 18 0A", "01 06 00 7D 00 00 19 D2"
    ask, moving, alarmed = "01 03 00 7F 00 01 B5 D2", "01 03 02 20 00 A1 84", "01 03 02 00 80 B9 E4"
    stage([(on, on), (ask, moving), (ask, alarmed), (off, off)]).stop()


def test_the_drive_is_told_to_watch_over_its_controller_for_as_long_as_it_moves(
    script: Callable[..., Address], links: Links, clock: SimulatedClock
) -> None:
    """1000 ms into the drive's parameter, the move, a status four times a second, then 0."""
    told = "01 10 13 8A 00 02 64 A6"
    on, off = "01 10 13 8A 00 02 04 00 00 03 E8 A2 3E", "01 10 13 8A 00 02 04 00 00 00 00 A2 80"
    beats = [(ASK_STATUS, MOVING)] * 31
    moved = [*START[:2], (on, told), START[2], *beats, (ASK_STATUS, HOMED), (off, told), (ASK_POSITION, AT_8500)]
    watched = dataclasses.replace(SETTINGS, communication_timeout_s=1.0)
    oriental_az.connect(script(moved), links, watched, "alpha").move_to(85.0)
    assert clock.now() == pytest.approx(130 / 20 + 20 / 15, abs=0.01)


def test_homing_is_a_pulse_and_waits_for_home_end(stage: Stages) -> None:
    on, off = "01 06 00 7D 00 10 18 1E", "01 06 00 7D 00 00 19 D2"
    stage(
        [
            (ASK_ALARM, NO_ALARM),
            (on, on),
            (off, off),
            (ASK_STATUS, MOVING),
            (ASK_STATUS, STANDING),  # between its steps it stands without HOME-END
            (ASK_STATUS, HOMED),
        ]
    ).home()


def test_an_alarm_is_reset_by_0_then_1(stage: Stages) -> None:
    done = "01 10 01 80 00 02 41 DC"
    stage(
        [
            ("01 10 01 80 00 02 04 00 00 00 00 F6 5F", done),
            ("01 10 01 80 00 02 04 00 00 00 01 37 9F", done),
            (ASK_ALARM, NO_ALARM),
        ]
    ).reset_alarm()


def test_the_drive_tells_whether_it_is_referenced(stage: Stages) -> None:
    ask = "01 03 00 7F 00 01 B5 D2"
    drive = stage([(ask, "01 03 02 40 30 89 90"), (ask, "01 03 02 00 20 B9 9C")])
    assert drive.referenced()
    assert not drive.referenced()


LIMITS = (
    "01 10 03 86 00 06 0C "  # 6 registers from 0386
    "00 00 00 03 "  # brake, then alarm
    "00 00 27 10 "  # 10000 steps, 100 deg
    "FF FF DC D8 "  # -9000 steps, -90 deg
    "93 7F"
)
SET_LIMITS = (LIMITS, "01 10 03 86 00 06 A1 A6")
ASK_LIMITS = "01 03 03 86 00 06 24 65"
KEPT = "01 03 0C 00 00 00 03 00 00 27 10 FF FF DC D8 18 2A"
NOT_KEPT = "01 03 0C 00 00 00 03 00 00 00 00 00 00 00 00 87 80"


def limited(script: Callable[..., Address], links: Links, answer: str, *more: tuple[str, str]) -> RotaryStage:
    """A stage that is about to begin its first move."""
    exchanges = [(ASK_STATUS, HOMED), SET_LIMITS, (ASK_LIMITS, answer), *more]
    return oriental_az.connect(script(exchanges), links, dataclasses.replace(SETTINGS, own_limits=True), "alpha")


def test_the_drives_own_limits_are_written_and_read_back_before_the_first_move(
    script: Callable[..., Address], links: Links
) -> None:
    assert limited(script, links, KEPT, *START[1:]).start(85.0)


def test_limits_that_are_not_kept_let_nothing_move(script: Callable[..., Address], links: Links) -> None:
    with pytest.raises(Interlocked, match="it shows 3 in register 0x0386"):
        limited(script, links, NOT_KEPT).start(85.0)


TURN_TO_8500 = (
    "01 10 00 58 00 10 20 "  # 16 registers from 0058
    "00 00 00 00 "  # data number 0
    "00 00 00 01 "  # absolute positioning
    "00 00 21 34 "  # 8500 steps
    "00 00 03 E8 "  # 1000 Hz
    "00 00 05 DC 00 00 05 DC "  # 1.5 kHz/s
    "00 00 03 E8 "  # 100.0 %
    "00 00 00 01 "  # trigger: all
    "31 BF"
)
TURN_ON_AND_ON = (
    "01 10 00 58 00 10 20 "  # 16 registers from 0058
    "00 00 00 00 "  # data number 0
    "00 00 00 07 "  # continuous, by position
    "00 00 00 00 "  # no target
    "FF FF F8 30 "  # -2000 Hz: backwards
    "00 00 05 DC 00 00 05 DC "  # 1.5 kHz/s
    "00 00 03 E8 "  # 100.0 %
    "00 00 00 01 "  # trigger: all
    "F2 BC"
)
ASK_SPEED = "01 03 00 D0 00 02 C5 F2"
GOING = "01 03 06 20 10 00 00 00 00 E7 D6"  # MOVE, HOME-END


def test_a_turn_at_a_constant_rate_is_a_move_at_that_speed_whose_end_lies_beyond(
    stage: Stages, clock: SimulatedClock
) -> None:
    """Run-up to 10 deg/s takes 3 1/3 deg, and 0.2 s more; after the turn come 0.5 s, and as much to brake."""
    there = [(ASK_STATUS, HOMED), (ASK_POSITION, AT_MINUS_4500)]
    turn = [(ASK_STATUS, GOING), (ASK_SPEED, "01 03 04 00 00 03 E8 FA 8D")]
    ended = [(ASK_STATUS, HOMED), (ASK_POSITION, AT_8500)]
    drive = stage([*there, *there, (TURN_TO_8500, TAKEN), *turn, *ended])
    with drive.turning(10.0, -45 + 16 / 3, 85 - 25 / 3) as turning:
        assert clock.now() == pytest.approx(10 / 15 + 0.2, abs=0.01)
        turning.require()
    assert clock.now() == pytest.approx(130 / 10 + 10 / 15, abs=0.01)


def test_a_turn_that_is_too_slow_is_found(stage: Stages) -> None:
    there = [(ASK_STATUS, HOMED), (ASK_POSITION, AT_MINUS_4500)]
    slow = [(ASK_STATUS, GOING), (ASK_SPEED, "01 03 04 00 00 03 D4 FA 9C")]
    on, off = "01 06 00 7D 00 20 18 0A", "01 06 00 7D 00 00 19 D2"
    stopped = [(on, on), ("01 03 00 7F 00 01 B5 D2", "01 03 02 40 30 89 90"), (off, off)]
    drive = stage([*there, *there, (TURN_TO_8500, TAKEN), *slow, *stopped])
    with pytest.raises(NotSettled, match=r"alpha: turns at 9.800 deg/s instead of 10.000 deg/s"):  # noqa: SIM117
        with drive.turning(10.0, -45 + 16 / 3, 85 - 25 / 3) as turning:
            turning.require()


def test_without_limits_it_turns_on_and_on_watched_until_it_is_stopped(
    script: Callable[..., Address], links: Links, clock: SimulatedClock
) -> None:
    told = "01 10 13 8A 00 02 64 A6"
    watch, leave = "01 10 13 8A 00 02 04 00 00 03 E8 A2 3E", "01 10 13 8A 00 02 04 00 00 00 00 A2 80"
    begun = [(ASK_STATUS, HOMED), (ASK_POSITION, AT_MINUS_4500), (ASK_STATUS, HOMED), (watch, told)]
    beats = [(ASK_STATUS, GOING)] * 6  # four a second, for 1.33 s of run-up and 0.2 s more
    on, off = "01 06 00 7D 00 20 18 0A", "01 06 00 7D 00 00 19 D2"
    stopped = [(on, on), ("01 03 00 7F 00 01 B5 D2", "01 03 02 40 30 89 90"), (off, off), (leave, told)]
    endless = dataclasses.replace(SETTINGS, limits_deg=(-math.inf, math.inf), communication_timeout_s=1.0)
    address = script([*begun, (TURN_ON_AND_ON, TAKEN), *beats, *stopped])
    with oriental_az.connect(address, links, endless, "alpha").turning(20.0, -45 - 52 / 3, -90.0) as turn:
        assert (turn.rate_deg_s, turn.beat_s) == (-20.0, 0.25)
        assert clock.now() == pytest.approx(20 / 15 + 0.2, abs=0.05)
