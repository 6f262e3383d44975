"""A large file of a sensor at rest, written, or read by the library alone.

`python -m tests.benchmark.reading write FILE MEGABYTES`, then `... read FILE`; the file's ending is csv or ulg.
"""

from __future__ import annotations

import struct
import sys
from pathlib import Path

import numpy as np

from calibrations.table import Array
from tests.calibrations.test_flight_logs import SENSOR, record

ROWS = 100_000  # that are written at once
CSV_HEADER = "t_s,ax_m_s2,ay_m_s2,az_m_s2,gx_rad_s,gy_rad_s,gz_rad_s,temp_c"
ULOG_TYPE = np.dtype(
    [("size", "<u2"), ("type", "S1"), ("message", "<u2"), ("times_us", "<u8", 2), ("device", "<u4"), ("xyzt", "<f4", 4)]
)


def main() -> None:
    file = Path(sys.argv[2])
    if sys.argv[1] == "write":
        write(file, 1_000_000 * int(sys.argv[3]))
    elif file.suffix == ".csv":
        np.loadtxt(file, delimiter=",", skiprows=1)
    else:
        from pyulog.core import ULog

        ULog(str(file))


def write(file: Path, size: int) -> None:
    """A file of at least `size` bytes: samples of one sensor at 1 kHz."""
    rng = np.random.default_rng(1)
    header, lines = {".csv": (f"{CSV_HEADER}\n".encode(), _csv_lines), ".ulg": (_ulog_header(), _ulog_messages)}[
        file.suffix
    ]
    with file.open("wb") as stream:
        stream.write(header)
        first = 0
        while stream.tell() < size:
            values = rng.normal([0, 0, 9.81, 0, 0, 0, 25], [0.01, 0.01, 0.01, 1e-3, 1e-3, 1e-3, 0.01], (ROWS, 7))
            stream.write(lines(np.arange(first, first + ROWS), values))
            first += ROWS


def _csv_lines(rows: Array, values: Array) -> bytes:
    lines = np.column_stack([rows / 1000.0, values]).tolist()
    return "".join("{:.3f},{:.6f},{:.6f},{:.6f},{:.7f},{:.7f},{:.7f},{:.3f}\n".format(*line) for line in lines).encode()


def _ulog_header() -> bytes:
    start = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    definitions = record("B", bytes(40)) + record("F", f"sensor_accel:{SENSOR}".encode())
    return start + definitions + record("A", struct.pack("<BH", 0, 0) + b"sensor_accel")


def _ulog_messages(rows: Array, values: Array) -> bytes:
    messages = np.zeros(len(rows), ULOG_TYPE)
    messages["size"], messages["type"] = ULOG_TYPE.itemsize - 3, b"D"
    messages["times_us"] = rows[:, None] * 1000 + [300, 0]
    messages["device"] = 5
    messages["xyzt"] = values[:, [0, 1, 2, 6]]
    return messages.tobytes()


if __name__ == "__main__":
    main()
