"""LabJack T7: the receiving end of a running stream. Bytes are fetched as they fall due, scans come out.

It waits in bounded time: bytes are due at the rate of the stream, and a device that is late by PATIENCE_S is silent.
One whose last bytes come late, though none is missing, has not sampled all the time: its clock stood still, or it left
out scans and did not tell. So the end of what is asked for is compared with the computer's own clock.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.errors import LinkTimeout, StreamError
from drivers.labjack_t7_stream import Packets
from drivers.links.link import Link

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
        taken, self._codes = self._codes[:samples], self._codes[samples:]
        return taken.reshape(scans, self._channels)

    def _decode(self, packets: int) -> NDArray[np.uint16]:
        """The samples of the next `packets` packets, fetched a good many at a time."""
        at_once = max(1, GATHER_BYTES // self._size)
        for done in range(0, packets, at_once):
            self._fetch(min(packets, done + at_once))
        end = packets * self._size
        data, self._data = self._data[:end], self._data[end:]
        self._decoded += packets
        return self._packets.codes(data)

    def _fetch(self, packets: int) -> None:
        """Wait until `packets` packets are there."""
        clock, wanted = self._link.clock, packets * self._size
        due_s = self._start_s + (self._decoded + packets) * self._packet_s
        clock.sleep(due_s - clock.now())
        asked_s = max(due_s, clock.now())  # who asks late has not been kept waiting
        deadline = clock.now() + PATIENCE_S + self._drift_s()
        while len(self._data) < wanted:
            more = self._link.read(deadline - clock.now())
            if not more:
                self._complain(wanted)
            self._data += more
            self._late_s = clock.now() - asked_s

    def _drift_s(self) -> float:
        """How far the clocks of device and computer may have run apart since the start."""
        return CLOCKS_APART * (self._link.clock.now() - self._start_s)

    def _require_in_time(self) -> None:
        if self._late_s > LATE_S + self._drift_s():
            raise StreamError(
                f"{self._name}: scans came {self._late_s:.2f} s later than the rate of the stream says",
                "Find out whether its clock stood still or it left out scans, and what keeps network or computer busy",
            )

    def _complain(self, wanted: int) -> None:
        self._packets.codes(self._data)  # the status of what came may say why
        before = self._decoded * self._size
        raise LinkTimeout(
            f"{self._name}: the stream fell silent after {before + len(self._data)} of {before + wanted} bytes",
            "Check network and power of the device, and that no other program uses its stream",
        )
