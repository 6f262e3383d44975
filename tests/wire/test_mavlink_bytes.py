"""Frames of MAVLink: bytes of pymavlink in both directions, and streams that are cut, damaged or not MAVLink at all."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v10 import common as v10
from pymavlink.dialects.v20 import common as v20

from drivers.digital.frames import FoundFrames, Frames
from drivers.mavlink_imu import messages as mav
from drivers.mavlink_imu.driver import SampleDecoder, Settings

DIALECTS = {mav.V1: v10, mav.V2: v20}
COUNTS = st.integers(-32768, 32767)
FLOATS = st.floats(width=32, allow_nan=False, allow_infinity=False)
HEARTBEAT = bytes.fromhex("FE 09 00 01 01 00 00 00 00 00 02 0C 00 03 03")  # without its checksum


def packer(version: int, sequence: int = 0) -> Any:
    """pymavlink's side of a link."""
    link = DIALECTS[version].MAVLink(None, srcSystem=1, srcComponent=1)
    link.seq = sequence
    return link


def theirs(version: int, name: str, sequence: int, *values: Any) -> bytes:
    """A frame that pymavlink packs."""
    kind = getattr(DIALECTS[version], f"MAVLink_{name.lower()}_message")
    return bytes(kind(*values).pack(packer(version, sequence)))


def found_in(data: bytes) -> tuple[Frames, FoundFrames, mav.Heads]:
    frames = Frames(mav.Mavlink())
    found = frames.take(data)
    return frames, found, mav.heads(found)


def test_the_checksum_is_that_of_the_definition() -> None:
    text = np.frombuffer(b"12345678", dtype=np.uint8)[None]
    assert mav.checksum(text, ord("9")) == [0x6F91]  # CRC-16/MCRF4XX of 123456789


@pytest.mark.parametrize("message", [*mav.MESSAGES.values()], ids=lambda message: message.name)
def test_number_and_extra_byte_are_those_of_pymavlink(message: mav.Message) -> None:
    kind = getattr(v20, f"MAVLink_{message.name.lower()}_message")
    assert (message.number, message.extra) == (kind.id, kind.crc_extra)
    assert message.dtype.itemsize == kind.unpacker.size
    assert message.least == getattr(v10, f"MAVLink_{message.name.lower()}_message").unpacker.size


@pytest.mark.parametrize("version", [mav.V1, mav.V2])
@given(st.integers(0, 255), st.integers(0, 2**32 - 1), st.lists(COUNTS, min_size=9, max_size=9), COUNTS)
def test_scaled_counts_are_the_same_bytes_both_ways(
    version: int, sequence: int, time: int, counts: list[int], temperature: int
) -> None:
    more = [temperature] if version == mav.V2 else []
    data = theirs(version, "SCALED_IMU2", sequence, time, *counts, *more)
    message = mav.IMU["SCALED_IMU2"]
    triads = {sensor: counts[3 * k : 3 * k + 3] for k, sensor in enumerate("agm")}
    own = mav.fields(message, time=time, **triads, temperature=more[0] if more else 0)
    assert mav.frames(message, own, np.array([sequence]), 1, 1, version) == [data]
    frames, found, heads = found_in(data)
    assert (frames.good, frames.damaged, frames.remainder) == (1, 0, b"")
    assert heads.sequence.tolist() == [sequence]
    assert mav.contents(found, heads, message, np.array([0])) == own


@pytest.mark.parametrize("version", [mav.V1, mav.V2])
@given(st.integers(0, 2**52), st.lists(FLOATS, min_size=13, max_size=13), st.integers(0, 65535))
def test_high_resolution_values_are_the_same_bytes_both_ways(
    version: int, time: int, numbers: list[float], updated: int
) -> None:
    data = theirs(version, "HIGHRES_IMU", 9, time, *numbers, updated)
    triads = {name: numbers[3 * k : 3 * k + 3] for k, name in enumerate(("a", "g", "m", "pressure"))}
    own = mav.fields(mav.HIGHRES_IMU, time=time, **triads, temperature=numbers[12], updated=updated)
    assert mav.frames(mav.HIGHRES_IMU, own, np.array([9]), 1, 1, version) == [data]
    batch = SampleDecoder(Settings(outputs=("gx", "gy", "gz")), (1, 1)).take(data)
    assert batch.values.tolist() == [numbers[3:6]]
    assert batch.time is not None
    assert batch.time.tolist() == [time]


def test_a_signed_frame_is_read() -> None:
    link = packer(mav.V2)
    link.signing.secret_key, link.signing.sign_outgoing, link.signing.timestamp = b"k" * 32, True, 10**12
    data = bytes(v20.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3).pack(link))
    frames, _, heads = found_in(data + data)
    assert (len(data), frames.good, heads.number.tolist()) == (12 + 9 + 13, 2, [0, 0])


def test_a_heartbeat_in_plain_bytes_is_read() -> None:
    check = int(mav.checksum(np.frombuffer(HEARTBEAT[1:], dtype=np.uint8)[None], 50)[0])
    data = HEARTBEAT + check.to_bytes(2, "little")
    assert v10.MAVLink(None).decode(bytearray(data)).autopilot == 12
    _, found, heads = found_in(data)
    assert mav.contents(found, heads, mav.HEARTBEAT, np.array([0]))["autopilot"] == [12]


@given(st.binary(max_size=400), st.lists(st.integers(1, 90), max_size=20))
def test_any_bytes_can_come_and_the_cuts_do_not_matter(data: bytes, cuts: list[int]) -> None:
    whole, parts, numbers, at = Frames(mav.Mavlink()), Frames(mav.Mavlink()), [], 0
    expected = mav.heads(whole.take(data)).number.tolist()
    for n in [*cuts, len(data)]:
        numbers += mav.heads(parts.take(data[at : at + n])).number.tolist()
        at += n
    assert (numbers, parts.good, parts.remainder) == (expected, whole.good, whole.remainder)
    assert len(parts.remainder) <= mav.LONGEST + 13


@given(
    st.lists(st.tuples(st.integers(0, 255), st.binary(max_size=30)), min_size=1, max_size=20),
    st.lists(st.integers(1, 60), max_size=30),
)
def test_frames_between_other_bytes_are_found(pieces: list[tuple[int, bytes]], cuts: list[int]) -> None:
    """Bytes that could begin a frame are left out of the noise: a frame inside them would be lost with it."""
    frames = [theirs(mav.V2, "HEARTBEAT", number, 2, 12, 0, 0, 3, 3) for number, _ in pieces]
    noise = [bytes(b for b in other if b not in (mav.V1, mav.V2)) for _, other in pieces]
    data = b"".join(other + frame for frame, other in zip(frames, noise, strict=True))
    stream, sequences, at = Frames(mav.Mavlink()), [], 0
    for n in [*cuts, len(data)]:
        sequences += mav.heads(stream.take(data[at : at + n])).sequence.tolist()
        at += n
    assert sequences == [number for number, _ in pieces]
    assert stream.damaged == sum(map(bool, noise[1:]))


@given(st.integers(0, 2), st.integers(0, 20), st.integers(0, 7))
def test_a_flipped_bit_costs_one_frame(which: int, byte: int, bit: int) -> None:
    frames = [bytearray(theirs(mav.V2, "HEARTBEAT", k, 2, 12, 0, 0, 3, 3)) for k in range(3)]
    frames[which][byte % len(frames[which])] ^= 1 << bit
    good, found, heads = found_in(b"".join(frames) + bytes(mav.LONGEST))
    assert good.good == 2
    assert heads.sequence[found.known].tolist() == [k for k in range(3) if k != which]


def test_a_message_of_an_unknown_kind_between_others_keeps_the_numbers() -> None:
    beat = [theirs(mav.V2, "HEARTBEAT", k, 2, 12, 0, 0, 3, 3) for k in (4, 6)]
    other = theirs(mav.V2, "STATUSTEXT", 5, 6, b"hello")
    frames, found, heads = found_in(beat[0] + other + beat[1])
    assert heads.sequence.tolist() == [4, 5, 6]
    assert found.known.tolist() == [True, False, True]
    assert (frames.good, frames.damaged) == (2, 0)
