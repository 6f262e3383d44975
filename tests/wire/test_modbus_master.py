"""Requests and answers byte by byte, and each way an exchange can fail. Checksums are written out, not computed."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest

from drivers.clock import SimulatedClock
from drivers.errors import BadFrame, LinkRefused, LinkTimeout, Refused, WrongUnit
from drivers.transport import Address, Links
from drivers.transport.modbus import Register, Unit
from drivers.transport.server import Port, Server

ALARM = Register(0x0080, "uint32", "present alarm")
OUTPUTS = Register(0x007F, "uint16", "driver output status")
RATE = Register(4002, "float32", "STREAM_SCANRATE_HZ")
ASK_ALARM, NO_ALARM = "01 03 00 80 00 02 C5 E3", "01 03 04 00 00 00 00 FA 33"
TCP = "tcp://127.0.0.1:0"
Units = Callable[..., Unit]


def test_read_one_register(unit: Units) -> None:
    assert unit([(ASK_ALARM, "01 03 04 00 00 00 4A 7B C4")]).read(ALARM) == 0x4A


def test_neighbours_are_read_in_one_exchange(unit: Units) -> None:
    stage = unit([("01 03 00 7F 00 03 34 13", "01 03 06 20 80 00 00 00 30 27 DF")])
    assert stage.read_block(OUTPUTS, ALARM) == [0x2080, 0x30]


def test_one_word_is_written_by_function_6(unit: Units) -> None:
    echo = "01 06 00 7D 00 20 18 0A"
    unit([(echo, echo)]).write(Register(0x007D, "uint16", "inputs"), 0x20)


def test_two_words_are_written_by_function_16(unit: Units) -> None:
    reset = Register(0x0180, "uint32", "alarm reset")
    unit([("01 10 01 80 00 02 04 00 00 00 01 37 9F", "01 10 01 80 00 02 41 DC")]).write(reset, 1)


def test_bits_are_written_and_read(unit: Units) -> None:
    oven = unit(
        [
            ("01 05 08 14 FF 00 CE 5E", "01 05 08 14 FF 00 CE 5E"),
            ("01 02 08 14 00 01 FB AE", "01 02 01 01 60 48"),
        ]
    )
    oven.write_bit(0x0814, True, "run")
    assert oven.read_bit(0x0814, "run") is True


def test_frames_over_tcp_carry_a_number(unit: Units) -> None:
    device = unit(
        [
            ("00 01 00 00 00 06 01 03 0F A2 00 02", "00 01 00 00 00 07 01 03 04 44 7A 00 00"),
            ("00 02 00 00 00 0B 01 10 0F A2 00 02 04 44 7A 00 00", "00 02 00 00 00 06 01 10 0F A2 00 02"),
        ],
        TCP,
    )
    assert device.read(RATE) == 1000.0
    device.write(RATE, 1000.0)


def test_a_late_answer_to_an_earlier_request_is_passed_over(unit: Units) -> None:
    late, right = "FF FF 00 00 00 07 01 03 04 3F 80 00 00", "00 01 00 00 00 07 01 03 04 44 7A 00 00"
    device = unit([("00 01 00 00 00 06 01 03 0F A2 00 02", f"{late} {right}")], TCP)
    assert device.read(RATE) == 1000.0


def test_silence_is_a_time_out_after_two_retries(unit: Units, clock: SimulatedClock) -> None:
    started = time.monotonic()
    with pytest.raises(LinkTimeout) as raised:
        unit([(ASK_ALARM, "")] * 3).read(ALARM)
    assert str(raised.value).startswith(
        "alpha: reading register 0x0080 (present alarm): no answer within 0.5 s on rtu+tcp://127.0.0.1:"
    )
    assert "Check power, cable and unit id" in raised.value.remedy
    assert 1.5 <= clock.now() < 1.6
    assert time.monotonic() - started < 1.0


def test_an_answer_to_the_second_asking_will_do(unit: Units) -> None:
    assert unit([(ASK_ALARM, ""), (ASK_ALARM, NO_ALARM)]).read(ALARM) == 0


def test_a_wrong_checksum_is_a_bad_frame(unit: Units) -> None:
    with pytest.raises(BadFrame, match=r"alpha: reading register 0x0080 .*: the checksum of .* is wrong. Check"):
        unit([(ASK_ALARM, "01 03 04 00 00 00 00 FA 34")] * 3).read(ALARM)


def test_half_an_answer_is_a_bad_frame(unit: Units) -> None:
    with pytest.raises(BadFrame, match=r"received 5 bytes that are not an answer \(01 03 04 00 00\)"):
        unit([(ASK_ALARM, "01 03 04 00 00")] * 3).read(ALARM)


def test_an_answer_to_another_request_is_a_bad_frame(unit: Units) -> None:
    with pytest.raises(BadFrame, match="another request"):
        unit([(ASK_ALARM, "01 03 02 40 30 89 90")] * 3).read(ALARM)


def test_an_answer_of_another_unit_is_an_error(unit: Units) -> None:
    with pytest.raises(WrongUnit, match="unit 2 answered instead of unit 1"):
        unit([(ASK_ALARM, "02 03 04 00 00 00 00 C9 33")] * 3).read(ALARM)


def test_an_exception_answer_is_not_asked_again(unit: Units) -> None:
    with pytest.raises(Refused, match=r"alpha: .*0x0080.*: exception 2, it has no such register") as raised:
        unit([(ASK_ALARM, "01 83 02 C0 F1")]).read(ALARM)
    assert raised.value.code == 2


def test_a_lost_connection_is_refused(clock: SimulatedClock, links: Links) -> None:
    server = Server([Port("rtu+tcp://127.0.0.1:0")], {}, {})
    clock.attach(server)
    stage = links.unit(Address(server.url), "alpha")
    server.close()
    with pytest.raises(LinkRefused, match="the connection is lost"):
        stage.read(ALARM)


def test_units_of_one_url_share_the_wire(script: Callable[..., Address], links: Links) -> None:
    address = script([(ASK_ALARM, NO_ALARM), ("02 03 00 7F 00 01 B5 E1", "02 03 02 00 20 FD 9C")])
    assert links.unit(address, "alpha").read(ALARM) == 0
    assert links.unit(Address(address.url, 2), "beta").read(OUTPUTS) == 0x20
