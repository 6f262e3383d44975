"""LabJack T7: the receiving end of a running stream, from bytes to scans.

It waits in bounded time: bytes are due at the rate of the stream, and a device that is late by PATIENCE_S is silent.
If no byte is missing but the last ones come late, the device did not sample all the time: its clock stopped, or it
skipped scans without a report. Therefore the arrival of the last requested scan is compared with the computer's clock.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.errors import LinkTimeout, StreamError
from drivers.labjack_t7.registers import RANGES_V
from drivers.transport.link import Link

# LabJack T7: stream packets, and volts out of codes by the device's own calibration.
#
# Packet  `>HHHBBBBHHH`: transaction, 0, length (10 + data bytes), unit 1, function 76, type 16, reserved,
#         backlog in bytes, status, additional information; then the samples as U16. The transaction is 0 in the first
#         packet of each stream, and grows by 1.
# Source  T-series datasheet, stream mode and analog input calibration; LabJack's example of a stream by Modbus TCP
#         (`streamStart` and `spontaneousStreamRead`), which expects the transaction 0 after each start.

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
    fields = [("kind", "u1"), ("reserved", "u1"), ("backlog", ">u2"), ("status", ">u2"), ("additional", ">u2")]
    return np.dtype([*header, *fields, ("samples", ">u2", (samples,))])


class Packets:
    """The packets of one stream, `samples` samples in each: bytes in, codes out, and nothing missing.

    `first` is the transaction number of the first packet.
    """

    def __init__(self, samples: int, name: str, first: int = 0) -> None:
        self.layout = packet_type(samples)
        self._name = name
        self._packet_count = 0
        self._remainder = b""
        self._last = np.array([first - 1])  # transaction number of the last packet seen

    def codes(self, data: bytes | bytearray) -> NDArray[np.uint16]:
        """The samples of all packets that `data` completes, one after the other.

        Raises StreamError when the device reports lost scans, a packet is missing, or one is not of this stream.
        """
        data = self._remainder + data
        packets = np.frombuffer(data, self.layout, count=len(data) // self.layout.itemsize)
        self._remainder = bytes(data[len(packets) * self.layout.itemsize :])
        self._require_ours(packets)
        self._require_no_loss(packets)
        self._require_all(packets["transaction"].astype(np.int64))
        self._packet_count += len(packets)
        return packets["samples"].astype(np.uint16).ravel()

    def _require_ours(self, packets: NDArray[np.void]) -> None:
        expected = (0, self.layout.itemsize - 6, UNIT, FUNCTION, KIND)
        fields = ("protocol", "length", "unit", "function", "kind")
        for field, value in zip(fields, expected, strict=True):
            if (wrong_packets := np.flatnonzero(packets[field] != value)).size:
                got = packets[field][wrong_packets[0]]
                fault = f"packet {self._packet_count + wrong_packets[0]} has {field} {got} instead of {value}"
                raise StreamError(
                    f"{self._name}: {fault}", "Close other programs that use the device's stream, then repeat"
                )

    def _require_no_loss(self, packets: NDArray[np.void]) -> None:
        status = packets["status"]
        if (bad_packets := np.flatnonzero((status != 0) & (status != BURST_COMPLETE))).size:
            packet = packets[bad_packets[-1]]
            words = STATUS.get(int(packet["status"]), "it reports status {status}")
            raise StreamError(
                f"{self._name}: {words.format(additional=packet['additional'], status=packet['status'])} "
                f"(status {packet['status']} in packet {self._packet_count + bad_packets[-1]})",
                REMEDY,
            )

    def _require_all(self, transactions: NDArray[np.int64]) -> None:
        numbers = np.concatenate([self._last, transactions])
        steps = np.mod(np.diff(numbers), 65536)
        if (gaps := np.flatnonzero(steps != 1)).size:
            step, packet_before = int(steps[gaps[0]]), self._packet_count + int(gaps[0]) - 1
            fault = "are missing" if 1 < step < 32768 else "are repeated or out of order"
            place = f"after packet {packet_before}" if packet_before >= 0 else "at the start"
            raise StreamError(f"{self._name}: packets {fault} {place} of the record", REMEDY)
        self._last = numbers[-1:]


@dataclass(frozen=True)
class RangeCalibration:
    """One range of the converter: slopes in V per code above and below the center."""

    positive_slope: float
    negative_slope: float
    center: float
    offset: float

    @classmethod
    def from_flash(cls, words: Sequence[int], range_v: float) -> RangeCalibration:
        """Calibration of the fast converter, from words of the flash memory."""
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


GATHER_BYTES = 32768  # let this much arrive before it is read: well within any receive buffer
PATIENCE_S = 1.0  # beyond the time at which the bytes were due
LATE_S = 0.25  # what network and computer may hold up bytes that are on their way
CLOCKS_APART = 1e-4  # how much faster one of two quartz clocks may run


class Reception:
    """Scans of `channels` samples of a stream that was started at `start_s`, in packets of `per_packet` scans."""

    def __init__(
        self, link: Link, name: str, start_s: float, rate_hz: float, channels: int, per_packet: int
    ) -> None:  # fmt: skip
        self._link, self._name, self._start_s, self._channels = link, name, start_s, channels
        self._per_packet, self._packet_s = channels * per_packet, per_packet / rate_hz
        self._packets = Packets(self._per_packet, name)
        self._size = self._packets.layout.itemsize
        self._data = bytearray()  # fetched, not yet decoded
        self._decoded = 0  # packets
        self._codes = np.empty(0, np.uint16)  # decoded, not yet taken
        self._late_s = 0.0  # how much later the last bytes came than they were due

    def take(self, scans: int) -> NDArray[np.uint16]:
        """The codes of the next `scans` scans, shape (scans, channels).

        Raises LinkTimeout when they do not come, StreamError when some were lost or are not of their time.
        """
        samples = scans * self._channels
        if (missing := samples - len(self._codes)) > 0:
            self._codes = np.concatenate([self._codes, self._decode(-(-missing // self._per_packet))])
            self._require_in_time()
        codes, self._codes = self._codes[:samples], self._codes[samples:]
        return codes.reshape(scans, self._channels)

    def _decode(self, packets: int) -> NDArray[np.uint16]:
        """The samples of the next `packets` packets, fetched a good many at a time."""
        at_once = max(1, GATHER_BYTES // self._size)
        for decoded in range(0, packets, at_once):
            self._fetch(min(packets, decoded + at_once))
        end = packets * self._size
        data, self._data = self._data[:end], self._data[end:]
        self._decoded += packets
        return self._packets.codes(data)

    def _fetch(self, packets: int) -> None:
        """Wait until `packets` packets are there."""
        clock, size = self._link.clock, packets * self._size
        due_s = self._start_s + (self._decoded + packets) * self._packet_s
        clock.sleep(due_s - clock.now())
        asked_s = max(due_s, clock.now())  # who asks late has not been kept waiting
        deadline = clock.now() + PATIENCE_S + self._drift_s()
        while len(self._data) < size:
            next_bytes = self._link.read(deadline - clock.now())
            if not next_bytes:
                self._complain(size)
            self._data += next_bytes
            self._late_s = clock.now() - asked_s

    def _drift_s(self) -> float:
        """The largest plausible difference between the clocks of device and computer since the start."""
        return CLOCKS_APART * (self._link.clock.now() - self._start_s)

    def _require_in_time(self) -> None:
        if self._late_s > LATE_S + self._drift_s():
            raise StreamError(
                f"{self._name}: scans arrived {self._late_s:.2f} s later than the rate of the stream requires",
                "Check whether its clock stopped or it skipped scans, and whether network or computer are overloaded",
            )

    def _complain(self, size: int) -> None:
        self._packets.codes(self._data)  # the status of the received packets may contain the reason
        bytes_before = self._decoded * self._size
        raise LinkTimeout(
            f"{self._name}: the stream stopped after {bytes_before + len(self._data)} of {bytes_before + size} bytes",
            "Check network and power of the device, and that no other program uses its stream",
        )
