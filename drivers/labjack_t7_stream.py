"""LabJack T7: stream packets, and volts out of codes by the device's own calibration.

Packet  `>HHHBBBBHHH`: transaction, 0, length (10 + data bytes), unit 1, function 76, type 16, reserved,
        backlog in bytes, status, additional information; then the samples as U16.
Source  T-series datasheet, stream mode and analog input calibration.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.errors import StreamError
from drivers.labjack_t7_table import RANGES_V

HEADER_BYTES = 16
UNIT, FUNCTION, KIND = 1, 76, 16
RECOVERING, RECOVERED, OVERLAP, SKIP_OVERFLOW, BURST_COMPLETE, BUFFER_FULL = range(2940, 2946)
STATUS = {
    RECOVERING: "its buffer ran over and it began to skip scans",
    RECOVERED: "its buffer ran over and it skipped {additional} scans",
    OVERLAP: "scans overlapped: the channels take longer than one scan",
    SKIP_OVERFLOW: "it lost count of the scans it skipped",
    BUFFER_FULL: "its buffer ran over and the stream stopped",
}
REMEDY = "Lower the rate or the number of channels, or free the network between device and computer"


def packet_type(samples: int) -> np.dtype[np.void]:
    """The layout of one packet of `samples` samples."""
    header = [("transaction", ">u2"), ("protocol", ">u2"), ("length", ">u2"), ("unit", "u1"), ("function", "u1")]
    rest = [("kind", "u1"), ("reserved", "u1"), ("backlog", ">u2"), ("status", ">u2"), ("additional", ">u2")]
    return np.dtype([*header, *rest, ("samples", ">u2", (samples,))])


class Packets:
    """The packets of one stream, `samples` samples in each: bytes in, codes out, and nothing missing in between."""

    def __init__(self, samples: int, name: str) -> None:
        self.layout = packet_type(samples)
        self._name = name
        self._seen = 0
        self._rest = b""
        self._last = np.empty(0, np.int64)  # transaction number of the last packet seen

    def codes(self, data: bytes | bytearray) -> NDArray[np.uint16]:
        """The samples of all packets that `data` completes, one after the other.

        Raises StreamError when the device reports lost scans, a packet is missing, or one is not of this stream.
        """
        data = self._rest + data
        packets = np.frombuffer(data, self.layout, count=len(data) // self.layout.itemsize)
        self._rest = bytes(data[len(packets) * self.layout.itemsize :])
        self._require_ours(packets)
        self._require_no_loss(packets)
        self._require_all(packets["transaction"].astype(np.int64))
        self._seen += len(packets)
        return packets["samples"].astype(np.uint16).ravel()

    def _require_ours(self, packets: NDArray[np.void]) -> None:
        expected = (0, self.layout.itemsize - 6, UNIT, FUNCTION, KIND)
        fields = ("protocol", "length", "unit", "function", "kind")
        for field, value in zip(fields, expected, strict=True):
            if (wrong := np.flatnonzero(packets[field] != value)).size:
                found = f"packet {self._seen + wrong[0]} has {field} {packets[field][wrong[0]]} instead of {value}"
                raise StreamError(f"{self._name}: {found}", "Let no other program use the device's stream, then repeat")

    def _require_no_loss(self, packets: NDArray[np.void]) -> None:
        status = packets["status"]
        if (bad := np.flatnonzero((status != 0) & (status != BURST_COMPLETE))).size:
            packet = packets[bad[-1]]
            words = STATUS.get(int(packet["status"]), "it reports status {status}")
            raise StreamError(
                f"{self._name}: {words.format(additional=packet['additional'], status=packet['status'])} "
                f"(status {packet['status']} in packet {self._seen + bad[-1]})",
                REMEDY,
            )

    def _require_all(self, transactions: NDArray[np.int64]) -> None:
        numbers = np.concatenate([self._last, transactions])
        steps = np.mod(np.diff(numbers), 65536)
        if (gaps := np.flatnonzero(steps != 1)).size:
            step, before = int(steps[gaps[0]]), self._seen - len(self._last) + gaps[0]
            wrong = "are missing" if 1 < step < 32768 else "come twice or out of order"
            raise StreamError(f"{self._name}: packets {wrong} after packet {before} of the record", REMEDY)
        self._last = numbers[-1:]


def codes_of(data: bytes | bytearray, samples: int, name: str) -> NDArray[np.uint16]:
    """The samples of all whole packets in `data`; raises StreamError as `Packets.codes`."""
    return Packets(samples, name).codes(data)


@dataclass(frozen=True)
class Calibration:
    """One range of the converter: slopes in V per code above and below the center."""

    positive_slope: float
    negative_slope: float
    center: float
    offset: float

    @classmethod
    def from_flash(cls, words: Sequence[int], range_v: float) -> Calibration:
        """Of the fast converter, out of the words read from flash."""
        constants = struct.unpack(f">{len(words) // 2}f", struct.pack(f">{len(words)}H", *words))
        first = 4 * RANGES_V.index(range_v)
        return cls(*constants[first : first + 4])

    @property
    def plausible(self) -> bool:
        """Whether slopes and center are those of a sound device: equal within 1 %, mid-scale within 5 %."""
        slopes = self.positive_slope > 0 and abs(self.negative_slope / self.positive_slope + 1) < 0.01
        return slopes and abs(self.center / 33523 - 1) < 0.05

    def table(self) -> NDArray[np.float64]:
        """Volts of every code, shape (65536,)."""
        distance = np.arange(65536) - self.center
        return np.where(distance < 0, -distance * self.negative_slope, distance * self.positive_slope)
