"""What can be wrong with the simulated T7's stream."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.labjack_t7_stream import BUFFER_FULL, RECOVERED, packet_type
from drivers.labjack_t7_table import HIGHEST_CODE
from drivers.links.faults import Faults, Kind
from drivers.links.modbus_server import MODBUS_FAULTS

FAULTS = {
    **MODBUS_FAULTS,
    "overflow": Kind("skips so many scans and says so, once", 50, "scan", least=1),
    "buffer-full": Kind("says that its buffer ran over, and streams no more, once"),
    "stall": Kind("streams nothing, though it was started"),
    "lost-packet": Kind("leaves out the second packet of a stream"),
    "duplicated-packet": Kind("sends the second packet of a stream twice"),
    "swapped-packets": Kind("sends the second packet of a stream after the third"),
    "clock-step": Kind("its clock stands still for so long in the middle of a stream, once", 0.5, "s", least=0.001),
    "over-range": Kind("has the first input beyond its range now and then"),
    "endless": Kind("streams on when it is told to stop"),
    "open-interlock": Kind("the contact at this digital line opens", 4, least=0),
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
    return bytes(packets[_order(packets["transaction"].astype(np.int64), faults, now_s)].tobytes())


def _order(numbers: NDArray[np.int64], faults: Faults, now_s: float) -> NDArray[np.intp]:
    """In which order packets of these transaction numbers are sent, as indices: the second is the one that suffers."""
    order = np.arange(len(numbers), dtype=np.intp)
    if faults.size("lost-packet", now_s) is not None:
        return np.flatnonzero(numbers != 1)
    if faults.size("duplicated-packet", now_s) is not None:
        return np.asarray(np.repeat(order, np.where(numbers == 1, 2, 1)))
    if faults.size("swapped-packets", now_s) is not None:
        return np.argsort(np.where(numbers == 1, 2.5, numbers), kind="stable")
    return order


def ends(data: bytes, samples: int) -> bool:
    """Whether these are the last packets of a stream whose buffer ran over."""
    return bool(data) and bool(np.frombuffer(data, packet_type(samples))["status"][-1] == BUFFER_FULL)
