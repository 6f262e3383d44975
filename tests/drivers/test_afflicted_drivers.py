"""Drivers whose simulated instruments have faults: none hangs, each says what is wrong, and nothing is left behind."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import pytest

from drivers.clock import SimulatedClock
from drivers.errors import DriverError, LinkTimeout, NotSettled, Refused, StageAlarm, StreamError
from drivers.transport.faults import EFFECTS, Fault, faults_of
from tests.drivers.digital import connected, usual_settings

DRIVERS = ["oriental_az", "labjack_t7", "omega_cn7500", "dpg2", "pi_e727"]
LONGEST_S = 60.0  # simulated, for an identification and a self-test


@pytest.fixture
def afflicted(small_world: Any) -> Iterator[Callable[..., tuple[Any, SimulatedClock]]]:
    """A driver on its twin, which has a fault as soon as it is connected."""
    with ExitStack() as opened:

        def make(name: str, fault: Fault, **settings: float) -> tuple[Any, SimulatedClock]:
            instrument, server, clock = opened.enter_context(
                connected(name, small_world, usual_settings(name, **settings))
            )
            server.afflict("alpha", faults_of(name, [fault]))
            return instrument, clock

        yield make


@pytest.mark.parametrize("name", ["oriental_az", "labjack_t7", "omega_cn7500"])
def test_an_exception_is_told_with_its_number(afflicted: Callable[..., Any], name: str) -> None:
    instrument, _ = afflicted(name, Fault("exception", size=6))
    with pytest.raises(Refused, match=r"alpha: .*exception 6, it is busy. Wait until it has finished") as refused:
        instrument.identify()
    assert refused.value.code == 6


@pytest.mark.parametrize(
    ("name", "what"),
    [
        *((name, what) for name in ("oriental_az", "omega_cn7500") for what in ("merged", "trickle", "garbage-after")),
        ("dpg2", "trickle"), ("labjack_t7", "trickle"), ("pi_e727", "trickle"),
    ],
)  # fmt: skip
def test_what_can_still_be_read_is_read(afflicted: Callable[..., Any], name: str, what: str) -> None:
    """On a line with checksums, or of whole lines of text, an answer that is not spoilt is the answer."""
    instrument, _ = afflicted(name, Fault(what))
    assert instrument.identify().model


STREAMS = [
    ("duplicated-packet", "alpha: packets are repeated or out of order after packet 1 of the record"),
    ("swapped-packets", "alpha: packets are missing after packet 0 of the record"),
    ("lost-packet", "alpha: packets are missing after packet 0 of the record"),
    ("clock-step", r"alpha: scans arrived 0\.50 s later than the rate of the stream requires. Check whether its clock"),
]


@pytest.mark.parametrize(("what", "said"), STREAMS)
def test_a_damaged_stream_is_an_error(afflicted: Callable[..., Any], what: str, said: str) -> None:
    converter, clock = afflicted("labjack_t7", Fault(what, at_s=0.5))
    clock.sleep(0.4)
    with pytest.raises(StreamError, match=said):
        converter.acquire(3.0)


def test_a_stream_without_its_first_packet_is_refused(afflicted: Callable[..., Any]) -> None:
    """It lasts 0.13 s, which is less than bytes may be late: only its number tells."""
    converter, _ = afflicted("labjack_t7", Fault("lost-packet", size=1), rate_hz=4000)
    with pytest.raises(StreamError, match="alpha: packets are missing at the start of the record"):
        converter.acquire(1.0)


@pytest.mark.parametrize("request_number", [0, 1, 2, 4])  # with 3 the packets of the stream are lost as well
@pytest.mark.parametrize("what", ["lost-answers", "delay", "garbage"])
def test_one_lost_answer_costs_no_record(afflicted: Callable[..., Any], what: str, request_number: int) -> None:
    """The device executed the command: a stream that it started must not be declined as another program's."""
    converter, _ = afflicted("labjack_t7", Fault(what, after=request_number, times=1))
    for _ in range(3):  # a stream that was left running would be found by the next one
        assert converter.acquire(0.5).volts.shape == (500, 1)


def test_a_stream_whose_start_is_never_answered_is_stopped(afflicted: Callable[..., Any]) -> None:
    converter, clock = afflicted("labjack_t7", Fault("lost-answers", after=2, for_s=7.0))
    with pytest.raises(LinkTimeout, match=r"no answer within 0\.5 s"):
        converter.acquire(0.5)
    clock.sleep(8.0)
    assert converter.acquire(0.5).volts.shape == (500, 1)


@pytest.mark.parametrize("what", EFFECTS)
@pytest.mark.parametrize("name", DRIVERS)
def test_no_driver_waits_for_ever_at_a_faulty_wire(afflicted: Callable[..., Any], name: str, what: str) -> None:
    instrument, clock = afflicted(name, Fault(what))
    for use in (instrument.identify, instrument.self_test):
        try:
            use()
        except DriverError as error:
            assert str(error).startswith("alpha: ")  # noqa: PT017 - a fault need not be felt
            assert error.remedy  # noqa: PT017
    assert clock.now() < LONGEST_S


@pytest.mark.parametrize("what", sorted(EFFECTS.keys() - {"disconnect"}))
@pytest.mark.parametrize("name", DRIVERS)
def test_a_fault_that_has_gone_leaves_nothing_behind(afflicted: Callable[..., Any], name: str, what: str) -> None:
    instrument, clock = afflicted(name, Fault(what, for_s=1.0))
    try:
        instrument.identify()
    except DriverError:
        clock.sleep(70.0)  # what babbles has a minute of it to say
    assert instrument.identify().model
    assert all(check.ok for check in instrument.self_test())


def test_a_connection_that_was_lost_is_opened_anew(afflicted: Callable[..., Any]) -> None:
    converter, _ = afflicted("labjack_t7", Fault("disconnect", times=1))
    with pytest.raises(DriverError, match=r"alpha: reading register 0xEA60 .* the connection is lost"):
        converter.identify()
    assert converter.identify().model == "LabJack T7"


def test_an_answer_on_its_way_is_lost_with_the_connection(afflicted: Callable[..., Any]) -> None:
    """Asked before, closed before it has answered: that is noticed at once, and not when the time for it is over."""
    converter, clock = afflicted("labjack_t7", Fault("disconnect", at_s=1.0, for_s=0.1))
    clock.sleep(0.9999 - clock.now())
    with pytest.raises(DriverError, match="the connection is lost"):
        converter.identify()
    assert clock.now() < 1.01


@pytest.mark.parametrize("what", ["silence", "garbage"])
def test_what_to_look_at_depends_on_the_wire(afflicted: Callable[..., Any], what: str) -> None:
    for name, told in (("labjack_t7", "address"), ("oriental_az", "parity")):
        instrument, _ = afflicted(name, Fault(what))
        with pytest.raises(DriverError) as failed:
            instrument.identify()
        assert told in str(failed.value)
        assert told == "parity" or "parity" not in str(failed.value), "a network has none"


# Every wait has a bound.


def test_a_stage_that_says_for_ever_that_it_moves(afflicted: Callable[..., Any]) -> None:
    stage, clock = afflicted("oriental_az", Fault("busy"))
    with pytest.raises(NotSettled, match=r"alpha: did not find its home position after 120 s. Look at the stage"):
        stage.home()
    with pytest.raises(NotSettled, match="alpha: has not stopped after 10 s"):
        stage.stop()
    assert clock.now() < 131


def test_a_positioner_that_says_for_ever_that_it_moves(afflicted: Callable[..., Any]) -> None:
    positioner, clock = afflicted("pi_e727", Fault("busy", at_s=1.0))
    positioner.servo(True)
    clock.sleep(1.0)
    with pytest.raises(NotSettled, match="alpha: x is not there after 5 s"):
        positioner.move_to("x", 50.0)
    with pytest.raises(NotSettled, match="alpha: an axis still moves after a stop after 1 s"):
        positioner.stop()
    assert clock.now() < 8


def test_a_positioner_that_never_ends_an_answer(afflicted: Callable[..., Any]) -> None:
    positioner, clock = afflicted("pi_e727", Fault("babble", size=0.5))
    with pytest.raises(DriverError, match="alpha: "):
        positioner.position_um("x")
    assert clock.now() < 400


@pytest.mark.parametrize("what", ["deaf", "babble"])
def test_a_level_that_never_stops_talking(afflicted: Callable[..., Any], what: str) -> None:
    level, clock = afflicted("dpg2", Fault(what))
    try:
        assert level.read().x_deg == pytest.approx(7.0, abs=0.01)  # it takes the next whole pair
    except DriverError as error:
        assert "alpha: asking for its reading" in str(error)  # noqa: PT017
    assert clock.now() < LONGEST_S


def test_a_stream_that_cannot_be_stopped_is_an_error(afflicted: Callable[..., Any]) -> None:
    converter, _ = afflicted("labjack_t7", Fault("endless"))
    converter.acquire(0.1)
    with pytest.raises(Refused, match="a stream is running already"):
        converter.acquire(0.1)


# The positioner's own faults.


def at_fifty(afflicted: Callable[..., Any], fault: Fault) -> tuple[Any, SimulatedClock]:
    positioner, clock = afflicted("pi_e727", fault)
    positioner.servo(True)
    positioner.move_to("x", 50.0)
    assert clock.now() < 5.0
    clock.sleep(5.0 - clock.now())
    return positioner, clock


@pytest.mark.parametrize(
    ("what", "error", "said"),
    [
        ("restart", Refused, "error 5, the servo is off, or the axis is not referenced. Switch the servo on"),
        ("stuck", NotSettled, r"x is at 50.0\d\d um instead of 20.000 um"),
        ("lies", NotSettled, r"x is at 21.0\d\d um|x is at 20.9\d\d um"),
        ("refuses", Refused, "error 17, a value is out of range"),
        ("silence", LinkTimeout, "alpha: no answer to ERR"),
    ],
)
def test_a_positioner_that_does_not_follow_its_command_is_an_error(
    afflicted: Callable[..., Any], what: str, error: type[DriverError], said: str
) -> None:
    positioner, _ = at_fifty(afflicted, Fault(what, at_s=5.0))
    with pytest.raises(error, match=said):
        positioner.move_to("x", 20.0)


def test_a_late_answer_of_a_positioner_is_not_that_to_the_next_question(afflicted: Callable[..., Any]) -> None:
    """POS? is answered after its time-out, when ERR? has been asked."""
    positioner, clock = at_fifty(afflicted, Fault("delay", at_s=5.0, for_s=1.2, size=1.3))
    with pytest.raises(LinkTimeout, match=r"alpha: no answer to POS\? 1 within 1 s"):
        positioner.position_um("x")
    assert positioner.position_um("x") == pytest.approx(50.0, abs=0.01)
    assert clock.now() < 9.0


def test_an_oscillation_that_ends_by_itself_is_noticed_and_a_stop_is_none(afflicted: Callable[..., Any]) -> None:
    positioner, clock = at_fifty(afflicted, Fault("restart", at_s=8.0))
    positioner.require_steady()
    positioner.oscillate("x", peak_to_peak_um=10.0, frequency_hz=10.0, centre_um=50.0)
    clock.sleep(1.0)
    positioner.require_steady()
    clock.sleep(3.0)
    with pytest.raises(StreamError, match=r"alpha: the oscillation of x has stopped. Check whether"):
        positioner.require_steady()
    positioner.stop()
    positioner.require_steady()


# A stage, and the drive that watches over its controller.


def test_a_late_answer_is_not_that_to_the_next_question(afflicted: Callable[..., Any]) -> None:
    """Both questions ask for two words: only the time tells the answers apart."""
    stage, clock = afflicted("oriental_az", Fault("delay", size=0.7, for_s=0.5))
    assert stage.angle_deg() == pytest.approx(7.0, abs=0.02)  # the late answer to the first asking; the second's is due
    assert stage.alarm() is None
    assert clock.now() > 1.7


def test_a_drive_stops_by_itself_when_its_controller_falls_silent(
    afflicted: Callable[..., Any], small_world: Any
) -> None:
    stage, clock = afflicted("oriental_az", Fault("busy", at_s=1e6))
    stage.settings = replace(stage.settings, communication_timeout_s=1.0)
    stage.home()
    began_s = clock.now()
    stage.start(90.0)
    clock.sleep(5.0)
    small_world.advance(clock.now())
    stood = small_world.motor_angle_deg("alpha")
    assert 15.0 < stood < 40.0  # a second at 30 deg/s, and braking
    with pytest.raises(
        StageAlarm,
        match=r"alarm 85, RS-485 communication time-out. Find out why the controller fell silent; then reset",
    ):
        stage.wait()
    assert clock.now() - began_s < 5.1
    stage.stop()
    assert small_world.motor_angle_deg("alpha") == stood


def test_a_drive_that_is_watched_arrives_and_then_needs_nobody(afflicted: Callable[..., Any]) -> None:
    stage, clock = afflicted("oriental_az", Fault("busy", at_s=1e6))
    stage.settings = replace(stage.settings, communication_timeout_s=0.5)
    stage.home()
    stage.move_to(120.0)
    clock.sleep(3600.0)
    assert stage.alarm() is None
    assert stage.angle_deg() == pytest.approx(120.0)
