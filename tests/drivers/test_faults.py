"""Faults of simulated instruments: when they are there, what a wire makes of them, and that no driver hangs on any."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib import import_module
from typing import Any

import pytest

from drivers.clock import SimulatedClock
from drivers.errors import DriverError, LinkTimeout, NotSettled, Refused, StageAlarm, StreamError
from drivers.links import Links
from drivers.links.faults import Fault, Faults, Kind
from drivers.links.modbus_server import RTU, TCP
from drivers.links.wire_faults import EFFECTS, Said, Wire, disturbed, faults_of, kinds_of

DRIVERS = ["oriental_az", "labjack_t7", "omega_cn7500", "dpg2", "pi_e727"]
LONGEST_S = 60.0  # simulated, for an identification and a self-test
KINDS = {"alarm": Kind("an alarm", 0x30), "stuck": Kind("does not move")}
ASK, ANSWER = bytes.fromhex("010300800002C5E3"), bytes.fromhex("01030400000000FA33")


@pytest.mark.parametrize(
    ("fault", "there", "not_there"),
    [
        (Fault("x"), [(0.0, 0), (1e9, 10**6)], []),
        (Fault("x", at_s=5.0), [(5.0, 0)], [(4.99, 99)]),
        (Fault("x", at_s=5.0, for_s=2.0), [(6.99, 0)], [(4.99, 0), (7.0, 0)]),
        (Fault("x", after=3), [(0.0, 4)], [(9.0, 3)]),
        (Fault("x", after=3, times=2), [(0.0, 4), (0.0, 5)], [(0.0, 3), (0.0, 6)]),
        (Fault("x", times=1), [(0.0, 0), (0.0, 1)], [(0.0, 2)]),
        (Fault("x", at_s=5.0, after=3), [(5.0, 4)], [(5.0, 3), (4.0, 4)]),
    ],
)
def test_a_fault_has_its_time(fault: Fault, there: list[Any], not_there: list[Any]) -> None:
    for now_s, asked in [*there, *not_there]:
        is_there = fault.has_begun(now_s, asked) and not fault.has_ended(now_s, asked)
        assert is_there == ((now_s, asked) in there), (now_s, asked)


@pytest.mark.parametrize(
    "wrong",
    [
        {"at_s": -1.0}, {"at_s": float("nan")}, {"after": -1}, {"for_s": 0.0}, {"times": 0},
        {"probability": 0.0}, {"probability": 1.5}, {"size": float("nan")},
    ],
)  # fmt: skip
def test_a_time_that_cannot_be_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="must"):
        Fault("x", **wrong)


def test_what_happens_once_happens_once_and_what_is_held_is_let_go() -> None:
    faults = Faults([Fault("alarm", at_s=5.0), Fault("stuck", at_s=2.0, for_s=2.0, size=7.0)], KINDS)
    assert faults.once("alarm", 4.0) is None
    assert faults.once("alarm", 6.0) == (0x30, 5.0)
    assert faults.once("alarm", 7.0) is None
    assert [faults.held("stuck", t, t) for t in (1.0, 2.5, 3.5, 4.5)] == [1.0, 2.5, 2.5, 4.5]
    assert [faults.size("stuck", t) for t in (1.0, 3.0)] == [None, 7.0]


def test_a_fault_with_a_probability_is_there_now_and_then_and_at_the_same_moments_again() -> None:
    def there(seed: int) -> list[bool]:
        faults = Faults([Fault("stuck", probability=0.3, seed=seed)], KINDS)
        return [faults.size("stuck", 0.1 * k) is not None for k in range(1000)]

    assert 250 < sum(there(1)) < 350
    assert there(1) == there(1) != there(2)


def test_what_happens_once_with_a_probability_is_drawn_at_each_request() -> None:
    faults = Faults([Fault("alarm", probability=0.1, seed=3)], KINDS)
    struck = 0
    for asked in range(1, 200):
        faults.asked()
        assert [faults.once("alarm", 0.01 * k) for k in range(50)].count(None) >= 49  # however often it is looked at
        struck = struck or (asked if faults.state()["struck"] else 0)
    assert 1 < struck < 60


@pytest.mark.parametrize(
    ("kind", "size", "said"),
    [
        (Kind("x", 8, "byte", least=1), 0, "must be at least 1 byte"),
        (Kind("x", 8, "byte", least=1), 1, None),
        (Kind("x", 1.0, "deg"), -3.0, None),
        (Kind("x"), 2.0, "this fault has no size; remove it"),
        (Kind("x"), None, None),
    ],
)
def test_a_size_that_a_fault_cannot_have(kind: Kind, size: float | None, said: str | None) -> None:
    assert kind.refusal(size) == said


def test_what_faults_remember_goes_on() -> None:
    faults = Faults([Fault("alarm"), Fault("stuck", after=2)], KINDS)
    faults.once("alarm", 1.0)
    for _ in range(3):
        faults.asked()
    faults.held("stuck", 1.0, [1.5])
    again = Faults([Fault("alarm"), Fault("stuck", after=2)], KINDS)
    again.restore(json.loads(json.dumps(faults.state())))
    assert again.once("alarm", 2.0) is None
    assert again.held("stuck", 2.0, [9.0]) == [1.5]


def test_a_fault_that_a_twin_cannot_have_is_refused() -> None:
    with pytest.raises(KeyError, match="stream"):
        faults_of("oriental_az", [Fault("stream")])


@pytest.mark.parametrize(
    ("what", "wire", "becomes"),
    [
        ("silence", RTU, []),
        ("lost-answers", RTU, []),
        ("delay", RTU, [(ANSWER, 1.7)]),
        ("truncated", RTU, [(ANSWER[:4], 1.0)]),
        ("merged", RTU, [(2 * ANSWER, 1.0)]),
        ("trickle", RTU, [(ANSWER[k : k + 1], 1.0 + 0.002 * k) for k in range(len(ANSWER))]),
        ("flipped-bit", RTU, [(bytes.fromhex("01230400000000FA33"), 1.0)]),
        ("flipped-bit", TCP, [(ANSWER, 1.2)]),  # the kernel mends it
        ("wrong-unit", RTU, [(bytes.fromhex("02030400000000C933"), 1.0)]),  # with a checksum that is right
        ("wrong-unit", Wire(mends=False), [(b"\x02" + ANSWER[1:], 1.0)]),
    ],
)
def test_what_a_wire_makes_of_an_answer(what: str, wire: Wire, becomes: list[Any]) -> None:
    assert disturbed(Said(ANSWER, 1.0), faults_of("oriental_az", [Fault(what)]), wire) == becomes


def test_noise_is_the_same_every_time() -> None:
    faults = faults_of("oriental_az", [Fault("garbage", size=5)])
    (noise,) = disturbed(Said(ANSWER, 1.0), faults, RTU)
    assert (len(noise.data), noise.due_s) == (5, 1.0)
    assert disturbed(Said(ANSWER, 1.0), faults, RTU) == [noise]


def test_noise_stands_before_or_after_what_is_said() -> None:
    (before,) = disturbed(Said(ANSWER, 1.0), faults_of("oriental_az", [Fault("garbage-before")]), RTU)
    (after,) = disturbed(Said(ANSWER, 1.0), faults_of("oriental_az", [Fault("garbage-after")]), RTU)
    assert (before.data[3:], after.data[:-3], len(before.data)) == (ANSWER, ANSWER, len(ANSWER) + 3)


def test_a_long_message_trickles_in_at_most_a_thousand_pieces() -> None:
    pieces = disturbed(Said(bytes(32768), 0.0), faults_of("labjack_t7", [Fault("trickle")]), TCP)
    assert len(pieces) <= 1000
    assert b"".join(piece.data for piece in pieces) == bytes(32768)


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
    ("duplicated-packet", "alpha: packets come twice or out of order after packet 1 of the record"),
    ("swapped-packets", "alpha: packets are missing after packet 0 of the record"),
    ("lost-packet", "alpha: packets are missing after packet 0 of the record"),
    ("clock-step", r"alpha: scans came 0\.50 s later than the rate of the stream says. Find out whether its clock"),
]


@pytest.mark.parametrize(("what", "said"), STREAMS)
def test_a_stream_that_is_not_what_it_should_be(afflicted: Callable[..., Any], what: str, said: str) -> None:
    converter, clock = afflicted("labjack_t7", Fault(what, at_s=0.5))
    clock.sleep(0.4)
    with pytest.raises(StreamError, match=said):
        converter.acquire(3.0)


def test_faults_add_up() -> None:
    faults = faults_of("oriental_az", [Fault("delay", size=0.5), Fault("garbage", size=3)])
    (said,) = disturbed(Said(ANSWER, 1.0), faults, RTU)
    assert (len(said.data), said.due_s) == (3, 1.5)


@pytest.fixture
def afflicted(small_world: Any) -> Iterator[Callable[..., tuple[Any, SimulatedClock]]]:
    """A driver on its twin, which has a fault as soon as it is connected."""
    opened: list[Any] = []

    def make(name: str, fault: Fault) -> tuple[Any, SimulatedClock]:
        driver, twin = import_module(f"drivers.{name}"), import_module(f"drivers.{name}_twin")
        settings = driver.Settings() if name != "labjack_t7" else driver.Settings(channels={"supply": 0})
        server, clock = twin.serve(small_world, {"alpha": (1, settings)}, twin.LISTEN), SimulatedClock()
        clock.attach(server)
        links = Links(clock)
        opened.extend([links, server])
        instrument = driver.connect(server.addresses["alpha"], links, settings, "alpha")
        server.afflict("alpha", faults_of(name, [fault]))
        return instrument, clock

    yield make
    for one in opened:
        one.close()


@pytest.mark.parametrize("what", EFFECTS)
@pytest.mark.parametrize("name", DRIVERS)
def test_no_driver_hangs_on_a_wire(afflicted: Callable[..., Any], name: str, what: str) -> None:
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
    with pytest.raises(NotSettled, match=r"alpha: has not found its home after 120 s. Look at the stage"):
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


def test_a_stream_that_never_ends(afflicted: Callable[..., Any]) -> None:
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
        ("stuck", NotSettled, r"x stands at 50.0\d\d um instead of 20.000 um"),
        ("lies", NotSettled, r"x stands at 21.0\d\d um|x stands at 20.9\d\d um"),
        ("refuses", Refused, "error 17, a value is out of range"),
        ("silence", LinkTimeout, "alpha: no answer to ERR"),
    ],
)
def test_a_positioner_that_does_not_do_as_it_was_told(
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
    with pytest.raises(StreamError, match=r"alpha: the oscillation of x has ended by itself. Find out"):
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
    with pytest.raises(StageAlarm, match=r"alarm 85, RS-485 communication time-out. The controller went silent"):
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


def test_every_fault_says_what_it_does() -> None:
    for name in DRIVERS:
        for what, kind in kinds_of(name).items():
            assert kind.doc, what
            assert bool(kind.size) or not kind.unit, what
