"""Logs in binary formats are refused by name, with a way to CSV; the file's first bytes decide, not its name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from calibrations.errors import DataError
from calibrations.files import open_text_file

ROW = np.arange(9.0)
WRITERS: dict[str, tuple[Callable[[Path], object], str]] = {
    "NumPy array": (lambda path: np.save(path, ROW), "numpy.savetxt"),
    "zip archive": (lambda path: np.savez(path, ax=ROW), "numpy.savetxt"),
    "MATLAB file": (lambda path: savemat(path, {"ax": ROW}), "writetable"),
}
HEADS = {  # from the formats' specifications
    "PX4 ULog": (b"ULog\x01\x12\x35\x01" + bytes(8), "ulog2csv"),
    "ArduPilot DataFlash": (b"\xa3\x95\x80\x80\x59FMT\0", "mavlogdump.py"),
    "ROS 1 bag": (b"#ROSBAG V2.0\n\x45\0\0\0", "rostopic echo"),
    "MCAP": (b"\x89MCAP0\r\n\x01" + bytes(8), "ros2 topic echo"),
    "SQLite": (b"SQLite format 3\0" + bytes(8), "ros2 topic echo"),
    "HDF5": (b"\x89HDF\r\n\x1a\n\0", "h5py"),
    "Parquet": (b"PAR1\x15\x04", "read_parquet"),
    "Betaflight Blackbox": (b"H Product:Blackbox flight data recorder\nH Data version:2\nI\0\0", "blackbox_decode"),
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_written_binary_file_is_refused_by_name(name: str, tmp_path: Path) -> None:
    write, tool = WRITERS[name]
    write(tmp_path / "log")
    (path,) = tmp_path.iterdir()
    with pytest.raises(DataError, match=f"{name}.*{tool}"):
        open_text_file(path)


@pytest.mark.parametrize("name", HEADS)
def test_the_first_bytes_name_the_format(name: str, tmp_path: Path) -> None:
    head, tool = HEADS[name]
    (tmp_path / "log.csv").write_bytes(head)
    with pytest.raises(DataError, match=f"{name}.*{tool}"):
        open_text_file(tmp_path / "log.csv")


def test_a_text_that_begins_like_a_format_is_still_read(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("MATLAB time,ax\n1,2\n")
    with open_text_file(tmp_path / "a.csv").lines() as lines:
        assert len(list(lines)) == 2
