"""MAVLink 1 and 2: frames with their checksum, and the messages that a digital sensor needs.

A frame of MAVLink 1 is FE, length, sequence, system, component, message, payload, checksum; one of MAVLink 2 is FD,
length, two bytes of flags, sequence, system, component, message of three bytes, payload, checksum, and a signature of
13 bytes if flag 1 is set. Fields are little-endian, sorted by size; a payload of MAVLink 2 ends with its last byte that
is not zero. The checksum covers all after the first byte, and a byte that depends on the message's fields, CRC_EXTRA.

Source  MAVLink, packet serialization; message definitions `common` and `minimal`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.digital.frames import BAD, GOOD, UNKNOWN, Bytes, FoundFrames, Ints, groups

V1, V2 = 0xFE, 0xFD
SIGNED, SIGNATURE = 0x01, 13  # flag of a signed frame, bytes of its signature
PLACES = {V1: (6, 2, 3, 4), V2: (10, 4, 5, 6)}  # first byte -> places of payload, sequence, system and component
_OTHERS = list(zip(PLACES[V1][1:], PLACES[V2][1:], strict=True))
LONGEST = 280  # bytes of a frame
SET_MESSAGE_INTERVAL = 511
RESULTS = {  # of a command
    0: "accepted",
    1: "temporarily rejected",
    2: "denied",
    3: "unsupported",
    4: "failed",
    5: "in progress",
}
AUTOPILOTS = {0: "generic autopilot", 3: "ArduPilot", 4: "OpenPilot", 9: "Paparazzi", 12: "PX4"}
INVALID = 8  # autopilot type of a component without one
OTHER_TYPES = (6, 18, 26, 27)  # ground station, onboard controller, gimbal, ADS-B
GROUND_STATION = 6


@dataclass(frozen=True)
class Message:
    """A message: `fields` as numpy types, of which the first `least` bytes belong to MAVLink 1."""

    name: str
    number: int
    extra: int
    least: int
    fields: Sequence[tuple[Any, ...]] = field(repr=False)

    @cached_property
    def dtype(self) -> np.dtype[np.void]:
        return np.dtype([*self.fields])


def _scaled_message(name: str, number: int, extra: int) -> Message:
    return Message(name, number, extra, 22, [("time", "<u4"), *_TRIADS, ("temperature", "<i2")])


_TRIADS = [(sensor, "<i2", 3) for sensor in "agm"]
HIGHRES_IMU = Message(
    "HIGHRES_IMU",
    105,
    93,
    62,
    [
        ("time", "<u8"),
        *((sensor, "<f4", 3) for sensor in "agm"),
        ("pressure", "<f4", 3),
        ("temperature", "<f4"),
        ("updated", "<u2"),
        ("id", "u1"),
    ],
)
RAW_IMU = Message("RAW_IMU", 27, 144, 26, [("time", "<u8"), *_TRIADS, ("id", "u1"), ("temperature", "<i2")])
IMU = {
    message.name: message
    for message in (
        HIGHRES_IMU,
        RAW_IMU,
        _scaled_message("SCALED_IMU", 26, 170),
        _scaled_message("SCALED_IMU2", 116, 76),
        _scaled_message("SCALED_IMU3", 129, 46),
    )
}
HEARTBEAT = Message(
    "HEARTBEAT",
    0,
    50,
    9,
    [("mode", "<u4"), ("type", "u1"), ("autopilot", "u1"), ("base_mode", "u1"), ("status", "u1"), ("version", "u1")],
)
COMMAND_LONG = Message(
    "COMMAND_LONG",
    76,
    152,
    33,
    [("parameters", "<f4", 7), ("command", "<u2"), ("system", "u1"), ("component", "u1"), ("confirmation", "u1")],
)
COMMAND_ACK = Message(
    "COMMAND_ACK",
    77,
    143,
    3,
    [
        ("command", "<u2"),
        ("result", "u1"),
        ("progress", "u1"),
        ("result2", "<i4"),
        ("system", "u1"),
        ("component", "u1"),
    ],
)
MESSAGES: Mapping[int, Message] = {m.number: m for m in (HEARTBEAT, COMMAND_LONG, COMMAND_ACK, *IMU.values())}


class Mavlink:
    """The form of a frame of MAVLink."""

    starts = re.compile(b"[\xfd\xfe]")
    head = 3

    def length(self, text: bytes, at: int) -> int | None:
        if at + self.head > len(text):
            return None
        first, size, flags = text[at : at + self.head]
        if first == V1:
            return size + 8
        return 0 if flags & ~SIGNED else size + 12 + SIGNATURE * flags

    def judge(self, frames: Bytes) -> Ints:
        verdicts = np.full(len(frames), UNKNOWN, dtype=np.int64)
        signed = (frames[:, 0] == V2) & (frames[:, 2] == SIGNED)
        for kind, group in groups(2 * _numbers(frames) + signed):
            if (message := MESSAGES.get(kind >> 1)) is not None:
                rows = frames[group, : frames.shape[1] - SIGNATURE * (kind & 1)]
                sent_checksums = rows[:, -2] + 256 * rows[:, -1].astype(np.uint16)
                verdicts[group] = np.where(sent_checksums == checksum(rows[:, 1:-2], message.extra), GOOD, BAD)
        return verdicts


@dataclass(frozen=True, eq=False)
class Heads:
    """Headers of the frames in a stream, each of shape (n,). `version` is the first byte."""

    version: Ints
    sequence: Ints
    system: Ints
    component: Ints
    number: Ints
    payload: Ints  # its place
    size: Ints  # its bytes


def heads(frames: FoundFrames) -> Heads:
    """The heads of the frames."""
    text = frames.heads(PLACES[V2][0])
    version = text[:, 0]
    first = version == V1
    payload = np.where(first, PLACES[V1][0], PLACES[V2][0])
    sequence, system, component = (
        np.where(first, text[:, place_v1], text[:, place_v2]) for place_v1, place_v2 in _OTHERS
    )
    return Heads(version, sequence, system, component, _numbers(text), payload, text[:, 1])


def contents(frames: FoundFrames, frame_heads: Heads, message: Message, frame_numbers: Ints) -> NDArray[np.void]:
    """The fields of the chosen frames of `message`, shape (n,); fields that a frame lacks are 0."""
    parts = np.zeros((len(frame_numbers), message.dtype.itemsize), dtype=np.uint8)
    for place, of_place in groups(frame_heads.payload[frame_numbers]):
        parts[of_place] = frames.parts(
            frame_numbers[of_place], place, frame_heads.size[frame_numbers[of_place]], message.dtype.itemsize
        )
    return parts.view(message.dtype)[:, 0]


def frames(
    message: Message, values: NDArray[np.void], sequences: Ints, system: int, component: int, version: int = V2
) -> list[bytes]:
    """The frames of a message: its fields, shape (n,), and the sequence number of each."""
    payload = values.reshape(-1, 1).view(np.uint8)
    if version == V1:
        sizes = np.full(len(payload), message.least)
    else:
        ends = np.argmax(payload[:, ::-1] != 0, axis=1)
        sizes = np.where(payload.any(axis=1), payload.shape[1] - ends, 1)
    messages: list[bytes] = [b""] * len(payload)
    for size, group in groups(sizes):
        rows = np.arange(len(payload))[group]
        head = [version, size, *([] if version == V1 else [0, 0]), 0, system, component]
        head += [(message.number >> shift) & 0xFF for shift in ((0,) if version == V1 else (0, 8, 16))]
        frame = np.empty((len(rows), len(head) + size + 2), dtype=np.uint8)
        frame[:, : len(head)] = head
        frame[:, PLACES[version][1]] = sequences[rows] % 256
        frame[:, len(head) : -2] = payload[rows, :size]
        check = checksum(frame[:, 1:-2], message.extra)
        frame[:, -2], frame[:, -1] = check & 0xFF, check >> 8
        text, length = frame.tobytes(), frame.shape[1]
        for k, row in enumerate(rows.tolist()):
            messages[row] = text[k * length : (k + 1) * length]
    return messages


def fields(message: Message, **values: Any) -> NDArray[np.void]:
    """The fields of one message, shape (1,). Fields that are not given are 0."""
    record = np.zeros(1, dtype=message.dtype)
    for name, value in values.items():
        record[name] = value
    return record


def checksum(rows: Bytes, extra: int) -> NDArray[np.uint16]:
    """CRC-16/MCRF4XX of each row and the byte `extra`, shape (n, bytes) -> (n,).

    It is linear in the bits: each byte contributes by its distance from the end alone.
    """
    begin, table = _contributions()
    n = rows.shape[1]
    parts = table.take(rows + 256 * np.arange(n, 0, -1))
    return np.asarray(np.bitwise_xor.reduce(parts, axis=1) ^ begin[n + 1] ^ table[extra], dtype=np.uint16)


@cache
def _contributions() -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """The checksum of n zeros, at n; and the contribution of a byte with n others behind it, at 256 n + byte."""
    first = np.arange(256, dtype=np.uint16)
    for _ in range(8):
        first = np.where(first & 1, (first >> 1) ^ 0x8408, first >> 1).astype(np.uint16)
    begin, table = [np.uint16(0xFFFF)], [first]
    for _ in range(LONGEST):
        begin.append((begin[-1] >> 8) ^ first[begin[-1] & 0xFF])
        table.append((table[-1] >> 8) ^ first[table[-1] & 0xFF])
    return np.array(begin), np.concatenate(table)


def _numbers(rows: NDArray[Any]) -> Ints:
    """The message of each frame by its first bytes, shape (n, 8 or more) -> (n,)."""
    if rows.shape[1] < 10:
        return rows[:, 5].astype(np.int64)
    wide = rows[:, 7:10].astype(np.int64) @ _SHIFTS
    return np.asarray(np.where(rows[:, 0] == V1, rows[:, 5], wide), dtype=np.int64)


_SHIFTS = np.array([1, 256, 65536])
