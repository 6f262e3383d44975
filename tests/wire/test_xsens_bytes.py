"""XBus: the bytes of the manufacturer's example, and streams that are cut, damaged or not XBus at all."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.digital.frames import Frames
from drivers.xsens_mti import messages as xbus
from drivers.xsens_mti.driver import SampleDecoder, Settings

# MT low level communication protocol example (mtidocs.movella.com), and MTi User Manual, 5.3.2 (ReqDID)
MANUAL = {
    "FA FF 30 00 D1": (xbus.GO_TO_CONFIG, ""),
    "FA FF 31 00 D0": (xbus.GO_TO_CONFIG + 1, ""),
    "FA FF 10 00 F1": (xbus.GO_TO_MEASUREMENT, ""),
    "FA FF 00 00 01": (xbus.DEVICE_ID, ""),
    "FA FF 18 01 80 68": (0x18, "80"),
    "FA FF 64 02 00 02 99": (0x64, "00 02"),
    "FA FF 65 00 9C": (0x65, ""),
}
SET_OUTPUTS = (
    "FA FF C0 28 10 20 FF FF 10 60 FF FF 20 10 00 64 40 20 01 90 80 20 01 90 C0 20 00 64 E0 20 FF FF 50 42 00 64 "
    "50 22 00 64 D0 12 00 64 73"
)
SAMPLE = bytes.fromhex(
    "FA FF 36 31 10 20 02 DF C5 10 60 04 00 45 9D A0 40 20 0C BE DC 9A FA 3F 54 9F 37 41 1C BB 70 80 20 0C BB AA 5C 80 "
    "3B 8C 55 01 BB 81 33 00 E0 20 04 00 00 00 81 45"
)
RECORDED = bytes.fromhex(
    "FA FF 36 4E 10 60 04 02 53 35 CB 20 10 10 3F 7F FA 66 BB 40 34 B8 3C 49 96 2D 3B 5A 1F 82 80 20 0C 39 FF 91 01 BA "
    "EC DD 81 BA 86 53 80 40 20 0C BE 64 DB 99 BC E7 FF 83 41 1D C2 CF C0 20 0C BE 90 48 80 3F 67 32 04 BF 54 89 04 E0 "
    "20 04 00 00 00 03 C9"
)
HIGH_RATE = bytes.fromhex("FA FF 36 0F 80 40 0C 3B 8B BC 00 BB E2 4F 00 3B 4E 4A 00 AF")
NUMBER_7 = bytes.fromhex("1020020007")
REALS = st.floats(-2000, 2000, width=32)


def decoded(data: bytes, outputs: tuple[str, ...]) -> tuple[SampleDecoder, list[list[float]]]:
    decoder = SampleDecoder(Settings(outputs=outputs))
    return decoder, decoder.take(data).values.tolist()


@pytest.mark.parametrize("text", list(MANUAL))
def test_messages_are_the_bytes_of_the_manual(text: str) -> None:
    number, data = MANUAL[text]
    assert xbus.message(number, bytes.fromhex(data)) == bytes.fromhex(text)
    stream = Frames(xbus.Xbus())
    assert list(xbus.messages(stream.take(bytes.fromhex(text)))) == [(number, bytes.fromhex(data))]
    assert (stream.good, stream.damaged, stream.remainder) == (1, 0, b"")


def test_an_output_configuration_is_that_of_the_manual() -> None:
    ((number, data),) = xbus.messages(Frames(xbus.Xbus()).take(bytes.fromhex(SET_OUTPUTS)))
    found = xbus.pairs(data)
    assert found[xbus.ACCELERATION] == found[xbus.RATE] == 400
    assert found[xbus.FIELD] == 100
    assert found[xbus.COUNTER] == xbus.MESSAGE_RATE
    assert xbus.message(number, xbus.configuration(found)) == bytes.fromhex(SET_OUTPUTS)
    with pytest.raises(ValueError, match="are not pairs"):
        xbus.pairs(data[:-1])


def test_the_measured_message_of_the_manual_is_read() -> None:
    batch = SampleDecoder(Settings(outputs=("ax", "ay", "az"))).take(SAMPLE)
    assert batch.values[0] == pytest.approx([-0.430870, 0.830554, 9.795761], abs=1e-6)
    assert batch.time is not None
    assert batch.time.tolist() == [0x00459DA0]
    assert batch.clipped == ""
    decoder, (rates,) = decoded(SAMPLE, ("gx", "gy", "gz"))
    assert rates == pytest.approx([-0.005199, 0.004283, -0.003943], abs=1e-6)
    assert decoder.good == 1
    assert decoded(SAMPLE, ("mx",))[1] == []


def test_data_that_other_programs_recorded_are_read() -> None:
    """Of two trackers at rest: all sensors and a quaternion; the high rate of the gyroscope. Neither has a number."""

    def read(recorded: bytes, *outputs: str) -> list[float]:
        ((number, data),) = xbus.messages(Frames(xbus.Xbus()).take(recorded))
        decoder, (values,) = decoded(xbus.message(number, NUMBER_7 + data), outputs)
        assert (decoder.good, decoder.damaged) == (1, 0)
        return values

    force = read(RECORDED, "ax", "ay", "az")
    assert force == pytest.approx([-0.2235, -0.0283, 9.8601], abs=1e-4)
    assert read(RECORDED, "gx", "gy", "gz") == pytest.approx([0.000487, -0.001807, -0.001025], abs=1e-6)
    assert np.linalg.norm(read(RECORDED, "mx", "my", "mz")) == pytest.approx(1.26, abs=0.01)
    assert read(HIGH_RATE, "gx", "gy", "gz") == pytest.approx([0.004265, -0.006906, 0.003148], abs=1e-6)
    assert decoded(RECORDED, ("ax", "ay", "az"))[1] == []


def test_the_numbers_of_messages_tell_what_is_missing() -> None:
    def numbered(count: int) -> bytes:
        data = bytearray(SAMPLE[4:-1])
        data[3:5] = struct.pack(">H", count % 65536)
        return xbus.message(xbus.DATA, bytes(data))

    batch = SampleDecoder(Settings(outputs=("ax",))).take(b"".join(map(numbered, (65534, 65535, 65536, 65539, 65539))))
    assert batch.missing is not None
    assert batch.missing.tolist() == [0, 0, 0, 2, -1]


@given(st.lists(REALS, min_size=3, max_size=3), st.sampled_from([0, 1, 2, 3]), st.sampled_from([0, 4, 8]))
def test_each_format_of_numbers_is_read(values: list[float], kind: int, frame: int) -> None:
    formats = {
        0: lambda v: struct.pack(">f", v),
        1: lambda v: struct.pack(">i", round(v * 2**20)),
        2: lambda v: struct.pack(">Ih", round(v * 2**32) % 2**32, round(v * 2**32) >> 32),
        3: lambda v: struct.pack(">d", v),
    }
    packed = b"".join(formats[kind](value) for value in values)
    packet = struct.pack(">HB", xbus.ACCELERATION | frame | kind, len(packed)) + packed
    data = bytes.fromhex("1020020007") + packet + bytes.fromhex("0999020102")  # and a packet of an unknown kind
    _, (found,) = decoded(xbus.message(xbus.DATA, data), ("ax", "ay", "az"))
    assert found == pytest.approx(values, abs=2**-20)


@given(st.binary(max_size=2048))
def test_a_message_survives_framing(data: bytes) -> None:
    stream = Frames(xbus.Xbus())
    assert list(xbus.messages(stream.take(b"noise" + xbus.message(0x12, data) + b"\xfa"))) == [(0x12, data)]
    assert stream.remainder == b"\xfa"


def test_too_much_data_is_refused() -> None:
    with pytest.raises(ValueError, match="at most 2048 bytes"):
        xbus.message(0, bytes(2049))


@given(st.binary(max_size=300), st.lists(st.integers(1, 90), max_size=20))
def test_any_bytes_can_come_and_the_cuts_do_not_matter(data: bytes, cuts: list[int]) -> None:
    data = data.replace(b"\xfb", b"\xfa\xff\x36")
    whole, parts, at, rows = SampleDecoder(Settings()), SampleDecoder(Settings()), 0, 0
    expected = len(whole.take(data).values)
    for n in [*cuts, len(data)]:
        rows += len(parts.take(data[at : at + n]).values)
        at += n
    assert (rows, parts.good, parts.stream.remainder) == (expected, whole.good, whole.stream.remainder)


@given(st.binary(max_size=120))
def test_any_content_of_a_sound_message_can_come(content: bytes) -> None:
    for data in (content, bytes.fromhex("1020020007") + content, bytes.fromhex("1020020007 40200C") + content):
        batch = SampleDecoder(Settings()).take(xbus.message(xbus.DATA, data))
        assert np.isfinite(batch.values).all()


@given(st.integers(0, len(SAMPLE) - 1), st.integers(0, 7))
def test_a_flipped_bit_costs_one_message(byte: int, bit: int) -> None:
    spoilt = bytearray(SAMPLE)
    spoilt[byte] ^= 1 << bit
    stream = Frames(xbus.Xbus())
    found = stream.take(SAMPLE + bytes(spoilt) + SAMPLE + bytes(xbus.LONGEST + 7))
    assert stream.good == 2
    assert [data for _, data in xbus.messages(found)] == [SAMPLE[4:-1]] * 2
    assert stream.damaged >= 1


def test_data_messages_are_read_back() -> None:
    time = np.arange(3, dtype=">u4")
    triad = np.arange(9, dtype=">f4").reshape(3, 3)
    counter = np.arange(3, dtype=">u2")
    made = xbus.data_messages([(xbus.COUNTER, counter), (xbus.TIME, time), (xbus.RATE, triad)])
    assert decoded(b"".join(made), ("gx", "gz"))[1] == [[0.0, 2.0], [3.0, 5.0], [6.0, 8.0]]
