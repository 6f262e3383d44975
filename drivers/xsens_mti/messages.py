"""XBus: messages with their checksum, and the data in an MTData2 message.

A message is FA, FF, its identifier, length, data and checksum; the bytes after FA add up to a multiple of 256. A length
of FF is followed by the length in two bytes. Numbers are big-endian. MTData2 has packets of identifier (2 bytes), size
(1 byte) and data; the last two bits of an identifier are the format of its numbers.

Source  Xsens MT Low Level Communication Protocol Documentation.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.digital.frames import BAD, GOOD, Bytes, FoundFrames, Ints, groups

Floats = NDArray[np.float64]
PREAMBLE, MASTER = 0xFA, 0xFF
GO_TO_CONFIG, GO_TO_MEASUREMENT, ERROR, DATA = 0x30, 0x10, 0x42, 0x36
DEVICE_ID, PRODUCT_CODE, FIRMWARE, OUTPUT_CONFIGURATION = 0x00, 0x1C, 0x12, 0xC0
COUNTER, TIME, STATUS, TEMPERATURE = 0x1020, 0x1060, 0xE020, 0x0810
ACCELERATION, RATE, FIELD = 0x4020, 0x8020, 0xC020
ACCELERATION_HR, RATE_HR = 0x4040, 0x8040
MESSAGE_RATE = 0xFFFF  # rate of an output that each message has
KIND, FORMAT = 0xFFF0, 0x0003  # of an identifier; bits 2 and 3 are the frame of an orientation
FLOAT32, FIXED_12_20, FIXED_16_32, FLOAT64 = range(4)
WIDTHS = {FLOAT32: 4, FIXED_12_20: 4, FIXED_16_32: 6, FLOAT64: 8}
LONGEST = 2048  # bytes of data
CLIPPED = 8  # bit of the status word for the first output; the others follow
ERRORS = {
    3: "invalid period",
    4: "invalid message",
    30: "timer overflow",
    32: "invalid baud rate",
    33: "invalid parameter",
    40: "device error",
    41: "more data than the baud rate allows",
    42: "buffer overflow",
}


class Xbus:
    """The kind of an XBus message."""

    starts = re.compile(b"\xfa")
    head = 6

    def length(self, text: bytes, at: int) -> int | None:
        head = text[at : at + self.head]
        if len(head) > 1 and head[1] != MASTER:
            return 0
        if len(head) < 4 or (head[3] == 0xFF and len(head) < self.head):
            return None
        if head[3] < 0xFF:
            return head[3] + 5
        size = head[4] << 8 | head[5]
        return size + 7 if size <= LONGEST else 0

    def judge(self, frames: Bytes) -> Ints:
        return np.where(frames[:, 1:].sum(axis=1, dtype=np.int64) % 256 == 0, GOOD, BAD)


def message(number: int, data: bytes = b"") -> bytes:
    """A message with its checksum. Raises ValueError for data beyond LONGEST."""
    if len(data) > LONGEST:
        raise ValueError(f"a message has at most {LONGEST} bytes of data")
    size = bytes([len(data)]) if len(data) < 0xFF else b"\xff" + len(data).to_bytes(2, "big")
    body = bytes([MASTER, number]) + size + data
    return bytes([PREAMBLE]) + body + bytes([-sum(body) % 256])


def messages(frames: FoundFrames) -> Iterator[tuple[int, bytes]]:
    """The identifier and the data of each message."""
    text = frames.data.tobytes()
    for start, length in zip(frames.starts.tolist(), frames.lengths.tolist(), strict=True):
        begin = 6 if text[start + 3] == 0xFF else 4
        yield text[start + 2], text[start + begin : start + length - 1]


def pairs(data: bytes) -> dict[int, int]:
    """Identifiers of outputs and their rates in Hz, of an output configuration. Raises ValueError for cut ones."""
    if len(data) % 4:
        raise ValueError(f"{len(data)} bytes are not pairs of identifier and rate")
    return dict(struct.iter_unpack(">HH", data))


def configuration(outputs: Mapping[int, int]) -> bytes:
    """The data of an output configuration."""
    return b"".join(struct.pack(">HH", *pair) for pair in outputs.items())


@dataclass(frozen=True)
class Packet:
    """One output in messages of the same layout: its place and size in bytes."""

    number: int
    place: int
    size: int

    @property
    def kind(self) -> int:
        return self.number & KIND


def layout(row: bytes) -> list[Packet] | None:
    """The packets of a whole MTData2 message; None where they do not fill its data."""
    start, end = 6 if row[3] == 0xFF else 4, len(row) - 1
    packets = []
    while start + 3 <= end:
        number, size = row[start] << 8 | row[start + 1], row[start + 2]
        packets.append(Packet(number, start + 3, size))
        start += 3 + size
    return packets if start == end else None


def find_alike(rows: Bytes, packets: Sequence[Packet]) -> NDArray[np.bool_]:
    """Flags of the messages that have the layout of the first one, among messages of the same length."""
    places = np.array([packet.place - k for packet in packets for k in (1, 2, 3)], dtype=np.int64)
    return np.asarray((rows[:, places] == rows[0, places]).all(axis=1))


def numbers(rows: Bytes, packet: Packet) -> Floats:
    """The real numbers of a packet in each message, shape (n, count); (n, 0) for a wrong size."""
    kind = packet.number & FORMAT
    width = WIDTHS[kind]
    count = 0 if packet.size % width else packet.size // width
    raw = np.ascontiguousarray(rows[:, packet.place : packet.place + count * width])
    if not count:
        return np.empty((len(rows), 0))
    if kind == FIXED_16_32:  # the fraction comes first
        parts = raw.reshape(len(rows), count, 6)
        fraction = np.ascontiguousarray(parts[..., :4]).view(">u4")[..., 0]
        return np.asarray(np.ascontiguousarray(parts[..., 4:]).view(">i2")[..., 0] + fraction / 2.0**32)
    types = {FLOAT32: ">f4", FIXED_12_20: ">i4", FLOAT64: ">f8"}
    return np.asarray(raw.view(types[kind]) / (2.0**20 if kind == FIXED_12_20 else 1.0), dtype=np.float64)


def integers(rows: Bytes, packet: Packet) -> Ints:
    """The unsigned integer of a packet in each message, shape (n,)."""
    weights = 256 ** np.arange(packet.size - 1, -1, -1)
    return np.asarray(rows[:, packet.place : packet.place + packet.size].astype(np.int64) @ weights)


def data_messages(columns: Sequence[tuple[int, NDArray[np.generic]]]) -> list[bytes]:
    """MTData2 messages: identifier and big-endian values, shape (n, ..), of each packet."""
    n, head, parts = len(columns[0][1]), 4, []
    for number, values in columns:
        data = np.ascontiguousarray(values).reshape(n, -1).view(np.uint8)
        parts += [np.tile(np.array([number >> 8, number & 0xFF, data.shape[1]], dtype=np.uint8), (n, 1)), data]
    body = np.concatenate(parts, axis=1)
    messages = np.empty((n, head + body.shape[1] + 1), dtype=np.uint8)
    messages[:, :head] = PREAMBLE, MASTER, DATA, body.shape[1]
    messages[:, head:-1] = body
    messages[:, -1] = -messages[:, 1:-1].sum(axis=1, dtype=np.int64) % 256
    text, length = messages.tobytes(), messages.shape[1]
    return [text[k * length : (k + 1) * length] for k in range(n)]


def layout_groups(frames: FoundFrames) -> Iterator[tuple[Ints, Bytes, list[Packet]]]:
    """The MTData2 messages in groups of one layout: their places among the frames, the messages, and the packets.

    Messages whose packets do not fill them are left out.
    """
    data = np.flatnonzero(frames.heads(3)[:, 2] == DATA)
    for length, group in groups(frames.lengths[data]):
        remaining = data[group]
        while len(remaining):
            rows = frames.data[frames.starts[remaining, None] + np.arange(length)]
            packets = layout(rows[0].tobytes())
            is_alike = find_alike(rows, packets) if packets else np.arange(len(rows)) == 0
            if packets:
                yield remaining[is_alike], rows[is_alike], packets
            remaining = remaining[~is_alike]
