"""Readers of binary logs and tables: their libraries meet damaged content, and we hold what they raise."""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from calibrations.errors import CalibrationError
from calibrations.importing.binary import open_sheet
from calibrations.importing.foreign import import_sheet
from calibrations.importing.topics import SeveralTopics
from tests.calibrations import test_array_files as arrays
from tests.calibrations import test_bags as bags
from tests.calibrations import test_flight_logs as flights
from tests.fuzz.files import file
from tests.fuzz.target import Target

__all__ = ["LOGS"]

RATE_HZ = 100.0


def imported(name: str, data: bytes) -> object:
    """Every topic of a file, as far as a table of it. The libraries print and warn; nobody reads that here."""
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        path = file(name, data)
        try:
            return import_sheet(open_sheet(path), None).table.n
        except SeveralTopics as several:
            return [import_sheet(open_sheet(path, topic), None).table.n for topic in [*several.topics][:3]]


def written(name: str, write: Callable[[Path], object]) -> bytes:
    """The bytes of a file that a library writes."""
    with TemporaryDirectory() as folder:
        path = write(Path(folder) / name)
        return (path if isinstance(path, Path) else Path(folder) / name).read_bytes()


def bag(storage: str, suffix: str) -> bytes:
    """A bag of three topics, in one file."""
    with TemporaryDirectory() as folder:
        path = bags.write(Path(folder), storage, "/words", "/imu", "/mag")
        return path.read_bytes() if path.is_file() else next(path.glob(f"*{suffix}")).read_bytes()


def target(name: str, *seeds: bytes, weight: int = 1) -> Target:
    """The reader of one format, by a file name of its own."""
    return Target(partial(imported, name), (CalibrationError,), seeds, weight)


ULOGS = (flights.ulog(("sensor_accel", 0, 5), ("sensor_mag", 0, 7)), flights.ulog(("sensor_accel", 0, 5)))
LOGS: dict[str, Target] = {
    "ulog": target("log.ulg", *ULOGS, weight=4),
    "dataflash": target("log.bin", flights.dataflash(), flights.dataflash(instances=2), weight=4),
    "ros1-bag": target("log.bag", bag("ros1", ".bag"), weight=2),
    "ros2-mcap": target("log.mcap", bag("mcap", ".mcap"), weight=2),
    "ros2-sqlite": target("log.db3", bag("sqlite3", ".db3")),
    "hdf5": target("log.h5", written("log.h5", arrays.hdf5), written("log.h5", arrays.hdf5_table)),
    "parquet": target("log.parquet", written("log.parquet", arrays.parquet)),
    "excel": target("log.xlsx", written("log.xlsx", arrays.excel)),
}
