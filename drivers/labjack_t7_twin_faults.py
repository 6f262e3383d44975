"""What can be wrong with the simulated T7's stream."""

from __future__ import annotations

import numpy as np

from drivers.labjack_t7_stream import BUFFER_FULL, RECOVERED, packet_type
from drivers.labjack_t7_table import HIGHEST_CODE
from drivers.links.faults import Faults, Kind

FAULTS = {
    "overflow": Kind("skips so many scans and says so, once", 50, "scan"),
    "buffer-full": Kind("says that its buffer ran over, and streams no more, once"),
    "stall": Kind("streams nothing, though it was started"),
    "lost-packet": Kind("leaves out the second packet of a stream"),
    "over-range": Kind("has the first input beyond its range now and then"),
    "endless": Kind("streams on when it is told to stop"),
    "restart": Kind("is without power for a moment: forgets all, and drops its connections, once"),
}


def spoilt(data: bytes, samples: int, faults: Faults, now_s: float) -> bytes:
    """Packets of so many samples as a stream with these faults sends them."""
    packets = np.frombuffer(bytearray(data), packet_type(samples))
    if faults.size("stall", now_s) is not None:
        return b""
    if faults.size("over-range", now_s) is not None:
        packets["samples"][:, 0] = HIGHEST_CODE
    if strike := faults.once("overflow", now_s):
        packets["status"][0], packets["additional"][0] = RECOVERED, strike.size
    if faults.once("buffer-full", now_s):
        packets["status"][-1] = BUFFER_FULL
    lost = faults.size("lost-packet", now_s) is not None
    return bytes(packets[packets["transaction"] != 1].tobytes() if lost else packets.tobytes())


def ends(data: bytes, samples: int) -> bool:
    """Whether these are the last packets of a stream whose buffer ran over."""
    return bool(data) and bool(np.frombuffer(data, packet_type(samples))["status"][-1] == BUFFER_FULL)
