"""Faults of simulated instruments: when they are there, what they remember, and what a wire makes of them."""

from __future__ import annotations

import json
from typing import Any

import pytest

from drivers.transport.faults import Fault, Faults, Kind, Message, Wire, disturb, faults_of, kinds_of
from drivers.transport.modbus_server import RTU, TCP

DRIVERS = ["oriental_az", "labjack_t7", "omega_cn7500", "dpg2", "pi_e727"]
KINDS = {"alarm": Kind("an alarm", 0x30), "stuck": Kind("does not move")}
ANSWER = bytes.fromhex("01030400000000FA33")


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
def test_a_fault_begins_and_ends_when_told(fault: Fault, there: list[Any], not_there: list[Any]) -> None:
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
    assert disturb(Message(ANSWER, 1.0), faults_of("oriental_az", [Fault(what)]), wire) == becomes


def test_noise_is_the_same_every_time() -> None:
    faults = faults_of("oriental_az", [Fault("garbage", size=5)])
    (noise,) = disturb(Message(ANSWER, 1.0), faults, RTU)
    assert (len(noise.data), noise.due_s) == (5, 1.0)
    assert disturb(Message(ANSWER, 1.0), faults, RTU) == [noise]


def test_noise_stands_before_or_after_what_is_said() -> None:
    (before,) = disturb(Message(ANSWER, 1.0), faults_of("oriental_az", [Fault("garbage-before")]), RTU)
    (after,) = disturb(Message(ANSWER, 1.0), faults_of("oriental_az", [Fault("garbage-after")]), RTU)
    assert (before.data[3:], after.data[:-3], len(before.data)) == (ANSWER, ANSWER, len(ANSWER) + 3)


def test_a_long_message_trickles_in_at_most_a_thousand_pieces() -> None:
    pieces = disturb(Message(bytes(32768), 0.0), faults_of("labjack_t7", [Fault("trickle")]), TCP)
    assert len(pieces) <= 1000
    assert b"".join(piece.data for piece in pieces) == bytes(32768)


def test_several_faults_act_together() -> None:
    faults = faults_of("oriental_az", [Fault("delay", size=0.5), Fault("garbage", size=3)])
    (said,) = disturb(Message(ANSWER, 1.0), faults, RTU)
    assert (len(said.data), said.due_s) == (3, 1.5)


def test_every_fault_says_what_it_does() -> None:
    for name in DRIVERS:
        for what, kind in kinds_of(name).items():
            assert kind.doc, what
            assert bool(kind.size) or not kind.unit, what
