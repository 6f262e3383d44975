"""Stream packets: literal ones first, then that every record survives and no loss goes unnoticed."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.errors import StreamError
from drivers.labjack_t7.stream import Packets, RangeCalibration, packet_type
from drivers.labjack_t7.twin import codes_of_volts

FIRST = bytes.fromhex("FF FF 00 00 00 0E 01 4C 10 00 00 00 00 00 00 00 00 01 80 00")
SECOND = bytes.fromhex("00 00 00 00 00 0E 01 4C 10 00 00 00 00 00 00 00 FF FF 00 02")
NOMINAL = RangeCalibration(0.00031580578, -0.0003158058, 33523, -10.58695652)


def packet(number: int, samples: list[int], status: int = 0, additional: int = 0) -> bytes:
    header = struct.pack(">HHHBBBBHHH", number, 0, 10 + 2 * len(samples), 1, 76, 16, 0, 0, status, additional)
    return header + struct.pack(f">{len(samples)}H", *samples)


def test_two_packets_and_the_number_turning_over() -> None:
    assert Packets(2, "adc", first=0xFFFF).codes(FIRST + SECOND).tolist() == [1, 0x8000, 0xFFFF, 2]


def test_half_a_packet_is_left_for_later() -> None:
    assert Packets(2, "adc", first=0xFFFF).codes(FIRST + SECOND[:7]).tolist() == [1, 0x8000]


def test_a_header_is_16_bytes() -> None:
    assert packet_type(512).itemsize == 16 + 1024


def test_a_missing_packet_is_noticed() -> None:
    with pytest.raises(StreamError, match="adc: packets are missing after packet 0"):
        Packets(2, "adc").codes(packet(0, [1, 2]) + packet(2, [3, 4]))


@pytest.mark.parametrize(
    ("number", "words"), [(1, "are missing"), (7, "are missing"), (65535, "are repeated or out of order")]
)
def test_a_stream_begins_with_transaction_0(number: int, words: str) -> None:
    """Else its first packet was lost, or a packet of the stream before came late."""
    with pytest.raises(StreamError, match=f"adc: packets {words} at the start of the record"):
        Packets(2, "adc").codes(packet(number, [1, 2]))


@pytest.mark.parametrize(
    ("offset", "value", "field"),
    [(3, 1, "protocol"), (5, 0x10, "length"), (6, 2, "unit"), (7, 3, "function"), (8, 17, "kind")],
)
def test_a_foreign_packet_is_noticed(offset: int, value: int, field: str) -> None:
    foreign = bytearray(FIRST + SECOND)
    foreign[20 + offset] = value
    with pytest.raises(StreamError, match=f"adc: packet 1 has {field} {value} instead of"):
        Packets(2, "adc", first=0xFFFF).codes(foreign)


@pytest.mark.parametrize(
    ("status", "words"),
    [
        (2940, "began to skip scans"),
        (2941, "skipped 7 scans"),
        (2942, "scans overlapped"),
        (2943, "lost count"),
        (2945, "buffer ran over and the stream stopped"),
        (1234, "it reports status 1234"),
    ],
)
def test_every_status_of_loss_is_put_into_words(status: int, words: str) -> None:
    with pytest.raises(StreamError, match=words):
        Packets(1, "adc").codes(packet(0, [1]) + packet(1, [2], status, 7))


def test_the_end_of_a_burst_is_no_loss() -> None:
    assert Packets(1, "adc").codes(packet(0, [1], 2944)).tolist() == [1]


@settings(derandomize=True, deadline=None)
@given(st.lists(st.lists(st.integers(0, 65535), min_size=3, max_size=3), max_size=20), st.integers(0, 65535))
def test_every_block_survives_the_packets(blocks: list[list[int]], first: int) -> None:
    data = b"".join(packet((first + k) % 65536, block) for k, block in enumerate(blocks))
    assert Packets(3, "adc", first).codes(data).tolist() == [code for block in blocks for code in block]


def test_volts_of_known_codes() -> None:
    volts = NOMINAL.table()
    assert volts[33523] == 0.0
    assert volts[33523 + 10000] == pytest.approx(3.1580578)
    assert volts[33523 - 10000] == pytest.approx(-3.158058)
    assert volts[0] == pytest.approx(NOMINAL.offset, abs=1e-3)


@settings(derandomize=True, deadline=None)
@given(st.integers(0, 65535), st.floats(0.99, 1.01), st.floats(0.99, 1.01))
def test_the_twins_converter_undoes_the_calibration(code: int, up: float, down: float) -> None:
    constants = RangeCalibration(NOMINAL.positive_slope * up, NOMINAL.negative_slope * down, 33500.25, 0.0)
    volts = constants.table()[code]
    assert codes_of_volts(np.array([[volts]]), [constants])[0, 0] == code


@pytest.mark.parametrize("range_v", [10.0, 1.0, 0.1, 0.01])
def test_each_range_has_its_own_four_constants(range_v: float) -> None:
    first = [10.0, 1.0, 0.1, 0.01].index(range_v) * 4
    words = struct.unpack(">82H", struct.pack(">41f", *range(41)))
    assert RangeCalibration.from_flash(words, range_v) == RangeCalibration(first, first + 1, first + 2, first + 3)


@pytest.mark.parametrize("constants", [(0.0, 0.0, 0.0, 0.0), (3e-4, 3e-4, 33523, -10), (3e-4, -3e-4, 65535, -10)])
def test_an_erased_calibration_is_not_plausible(constants: tuple[float, ...]) -> None:
    assert NOMINAL.plausible
    assert not RangeCalibration(*constants).plausible
