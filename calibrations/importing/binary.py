"""Open a file of any known format as a sheet: the first bytes decide, not the file's name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from calibrations.errors import DataError
from calibrations.files import open_text_file
from calibrations.importing.sheet import Sheet, read_sheet

if TYPE_CHECKING:
    from calibrations.importing.topics import Topic

MATLAB_HEADER_BYTES = 128
SMALL_BYTES = 1 << 26  # of a file whose values are never too many for memory
BAG = ("bags", "bag_topics")
HDF5_MARK = b"\x89HDF\r\n\x1a\n"
READERS: Mapping[bytes, tuple[str, str]] = {  # first bytes: the reader's module, imported when needed, and name
    HDF5_MARK: ("arrays", "hdf5_topics"),
    b"PAR1": ("arrays", "parquet_topics"),
    b"\x93NUMPY": ("arrays", "npy_topics"),
    b"ULog\x01\x12\x35": ("flight_logs", "ulog_topics"),
    b"\xa3\x95\x80": ("flight_logs", "dataflash_topics"),
    b"#ROSBAG V2.0": BAG,
    b"\x89MCAP0\r\n": BAG,
    b"SQLite format 3\0": BAG,
}
BAG_STORAGE = (".db3", ".mcap")
ZIP_ENCRYPTED = 1  # bit of the flags of a local file header (PKWARE APPNOTE 4.4.4)
CANNOT = {  # files that cannot be imported, by their first bytes: the reason and the remedy
    b"schema: rig.model/": "is a model file and holds no data; give it with --model",
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
        sheet = read_sheet(open_text_file(path, garbled=True))
        if topic is not None:
            raise DataError(f'{path}: has no topics, for it is a text; leave out --topic "{topic}"')
        return sheet
    from calibrations.importing.topics import topic_sheet

    with _unreadable_as_data_error(path):
        return topic_sheet(path, topics, topic)


def _topics(path: Path) -> list[Topic] | None:
    """The topics of a binary file, None for another file. Raises DataError."""
    try:
        if path.is_dir():
            if (path / "metadata.yaml").is_file():
                return _read_topics(BAG, path)
            if storage := next((file for file in sorted(path.iterdir()) if file.suffix in BAG_STORAGE), None):
                raise DataError(
                    f"{path}: is a ROS 2 bag without metadata.yaml; write it with `ros2 bag reindex`, or name the "
                    f"file {storage}"
                )
            return None
        with path.open("rb") as file:
            head = file.read(MATLAB_HEADER_BYTES)
    except OSError:
        return None  # the text reader gives the reason
    reader_name = next((reader for mark, reader in READERS.items() if head.startswith(mark)), None)
    if reason := next((reason for mark, reason in CANNOT.items() if head.startswith(mark)), None):
        raise DataError(f"{path}: {reason}")
    if _is_matlab_4(head):
        raise DataError(f"{path}: is a MATLAB file of version 4; save it in MATLAB with save(..., '-v7'), or as CSV")
    if len(head) == MATLAB_HEADER_BYTES and head[126:] in (b"IM", b"MI") and head.startswith(b"MATLAB 5"):
        reader_name = ("arrays", "matlab_topics")
    elif head.startswith(b"MATLAB 7.3"):
        reader_name = READERS[HDF5_MARK]
    elif head.startswith(b"PK\x03\x04"):
        if int.from_bytes(head[6:8], "little") & ZIP_ENCRYPTED:
            raise DataError(f"{path}: is a zip archive with a password; unpack it and import a file of it")
        reader_name = ("arrays", _zip_reader(path))
    if reader_name is None:
        return None
    return _read_topics(reader_name, path)


def _is_matlab_4(head: bytes) -> bool:
    """Whether a file begins as one of MATLAB 4 does: five integers for its first variable, and the variable's name."""
    orders: tuple[tuple[Literal["little", "big"], range], ...] = (("little", range(100)), ("big", range(1000, 1100)))
    for order, kinds in orders:
        kind, _, _, imaginary, length = (int.from_bytes(head[k : k + 4], order) for k in range(0, 20, 4))
        name = head[20 : 20 + length]
        if kind in kinds and imaginary in (0, 1) and name[-1:] == b"\0" and name[:-1].decode("latin-1").isidentifier():
            return True
    return False


def _read_topics(reader: tuple[str, str], path: Path) -> list[Topic]:
    module, name = reader
    read_topics: Callable[[Path], list[Topic]] = getattr(import_module(f"calibrations.importing.{module}"), name)
    with _unreadable_as_data_error(path):
        return read_topics(path)


@contextmanager
def _unreadable_as_data_error(path: Path) -> Iterator[None]:
    """Any error of a library is a DataError: the content is damaged."""
    try:
        yield
    except DataError:
        raise
    except MemoryError as error:
        if path.is_dir() or path.stat().st_size > SMALL_BYTES:
            raise
        raise _damage_error(path, error) from None  # a wrong length in so small a file
    except Exception as error:
        raise _damage_error(path, error) from None


def _zip_reader(path: Path) -> str:
    """The reader for a zip archive. Raises DataError."""
    from zipfile import BadZipFile, ZipFile, is_zipfile

    if not is_zipfile(path):
        raise DataError(f"{path}: is a cut zip archive (Excel or NumPy .npz); copy it again")
    try:
        with ZipFile(path) as archive:
            names = archive.namelist()
    except (BadZipFile, OSError, ValueError, NotImplementedError) as error:
        raise _damage_error(path, error) from None
    if "xl/workbook.xml" in names:
        return "excel_topics"
    if names and all(name.endswith(".npy") for name in names):
        return "npz_topics"
    raise DataError(f"{path}: is a zip archive, not an Excel workbook or NumPy .npz; unpack it and import a file of it")


def _damage_error(path: Path, error: Exception) -> DataError:
    reason = " ".join(str(error).split())[:200] or type(error).__name__
    return DataError(f"{path}: is damaged or cut short ({reason}); copy it again from where it was recorded")
