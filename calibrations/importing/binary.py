"""Open a file of any known format as a sheet: the first bytes decide, not the file's name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from zipfile import is_zipfile

from calibrations.errors import DataError
from calibrations.files import open_text_file
from calibrations.importing.arrays import (
    excel_topics,
    hdf5_topics,
    matlab_topics,
    npy_topics,
    npz_topics,
    parquet_topics,
)
from calibrations.importing.bags import SUFFIXES, bag_topics
from calibrations.importing.flight_logs import dataflash_topics, ulog_topics
from calibrations.importing.sheet import Sheet, read_sheet
from calibrations.importing.topics import Topic, topic_sheet

MATLAB_HEADER_BYTES = 128
HDF5_MARK = b"\x89HDF\r\n\x1a\n"
READERS: Mapping[bytes, Callable[[Path], list[Topic]]] = {
    HDF5_MARK: hdf5_topics,
    b"PAR1": parquet_topics,
    b"\x93NUMPY": npy_topics,
    b"ULog\x01\x12\x35": ulog_topics,
    b"\xa3\x95\x80": dataflash_topics,
    **dict.fromkeys(SUFFIXES, bag_topics),
}
CANNOT = {  # first bytes of what no library reads, and what to do
    b"ULogEnc": "is an encrypted PX4 ULog; decrypt it with decrypt_ulog.py of PX4-Autopilot and the log's private key",
    b"PARE": "is an encrypted Parquet file; save it without encryption",
    b"\xd0\xcf\x11\xe0": (
        "is an old Excel workbook (.xls), or one with a password; save it as .xlsx without a password, or as CSV"
    ),
}


def open_sheet(path: Path, topic: str | None = None) -> Sheet:
    """The sheet in a file: text, or one topic of a binary log.

    Raises SeveralTopics where a person has to choose a topic, DataError for a file that cannot be read.
    """
    topics = _topics(path)
    if topics is None:
        sheet = read_sheet(open_text_file(path))
        if topic is not None:
            raise DataError(f'{path}: has no topics, for it is a text; leave out --topic "{topic}"')
        return sheet
    try:
        return topic_sheet(path, topics, topic)
    except (DataError, MemoryError):
        raise
    except Exception as error:  # of a library, for damaged content
        raise _damaged(path, error) from None


def _topics(path: Path) -> list[Topic] | None:
    """The topics of a binary file, None for another file. Raises DataError."""
    try:
        if path.is_dir():
            return bag_topics(path) if (path / "metadata.yaml").is_file() else None
        with path.open("rb") as file:
            head = file.read(MATLAB_HEADER_BYTES)
    except OSError:
        return None  # the text reader gives the reason
    read = next((reader for mark, reader in READERS.items() if head.startswith(mark)), None)
    if said := next((said for mark, said in CANNOT.items() if head.startswith(mark)), None):
        raise DataError(f"{path}: {said}")
    if len(head) == MATLAB_HEADER_BYTES and head[126:] in (b"IM", b"MI") and head.startswith(b"MATLAB 5"):
        read = matlab_topics
    elif head.startswith(b"MATLAB 7.3"):
        read = hdf5_topics
    elif head.startswith(b"PK\x03\x04"):
        read = _zip_topics
    if read is None:
        return None
    try:
        return read(path)
    except (DataError, MemoryError):
        raise
    except Exception as error:  # of a library, for damaged content
        raise _damaged(path, error) from None


def _zip_topics(path: Path) -> list[Topic]:
    from zipfile import ZipFile

    if not is_zipfile(path):
        raise DataError(f"{path}: is a cut zip archive (Excel or NumPy .npz); copy it again")
    with ZipFile(path) as archive:
        names = archive.namelist()
    if "xl/workbook.xml" in names:
        return excel_topics(path)
    if names and all(name.endswith(".npy") for name in names):
        return npz_topics(path)
    raise DataError(f"{path}: is a zip archive, not an Excel workbook or NumPy .npz; unpack it and import a file of it")


def _damaged(path: Path, error: Exception) -> DataError:
    said = " ".join(str(error).split())[:200] or type(error).__name__
    return DataError(f"{path}: is damaged or cut short ({said}); copy it again from where it was recorded")
