"""Files as text, read line by line: encodings that spreadsheets write, gzip, no binary files; and safe YAML.

No file is held in memory as a whole, so a log of hundreds of megabytes needs memory for its numbers only.
"""

from __future__ import annotations

import codecs
import gzip
import io
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO, TextIO, cast

import yaml

from calibrations.errors import DataError

LARGEST_BYTES = 1 << 30
LONGEST_LINE_BYTES = 1 << 24
SMALL_BYTES = 1 << 26  # unpacked; up to here a file may be packed however tightly
LARGEST_RATIO = 50  # unpacked bytes for a packed one; logs of sensors, which are noise, have less than 10
HEAD_BYTES = 1 << 16
MARKS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
KNOWN_BINARY = (  # first bytes, name, and a way to CSV with the tools of the field
    (b"ULog\x01\x12\x35", "a PX4 ULog", "convert it with ulog2csv (of pyulog)"),
    (
        b"\xa3\x95\x80",
        "an ArduPilot DataFlash log",
        (
            "convert one message with mavlogdump.py --format csv --types ACC (of pymavlink); "
            "the autopilot logs ACC, GYR and MAG after its own correction"
        ),
    ),
    (b"#ROSBAG V2.0", "a ROS 1 bag", "convert one topic with rostopic echo -b FILE -p TOPIC > imu.csv"),
    (
        b"\x89MCAP0\r\n",
        "an MCAP log",
        "of ROS 2: play it, and save one topic with ros2 topic echo --csv TOPIC > imu.csv",
    ),
    (
        b"SQLite format 3\0",
        "an SQLite database",
        "of ROS 2: play it, and save one topic with ros2 topic echo --csv TOPIC > imu.csv",
    ),
    (b"MATLAB ", "a MATLAB file", "write its columns in MATLAB with writetable(table(...), 'imu.csv')"),
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file", "write its columns as CSV, for example with h5py and numpy.savetxt"),
    (b"PAR1", "a Parquet file", "write it as CSV, for example with pandas: read_parquet, to_csv"),
    (b"\x93NUMPY", "a NumPy array", "write it with numpy.savetxt(..., delimiter=',')"),
    (b"PK\x03\x04", "a zip archive (Excel, NumPy .npz)", "save the sheet as CSV, or the arrays with numpy.savetxt"),
    (b"H Product:Blackbox", "a Betaflight Blackbox log", "convert it with blackbox_decode"),
)
CONTROLS = frozenset(range(32)) - set(b"\t\n\r\f") - {0x1A}  # 0x1A ends a text file in old Windows programs


MOST_GARBLED = 0.01  # of the bytes: lines that were garbled on a wire


@dataclass(frozen=True)
class Source:
    """A text that can be read several times, and its name in messages."""

    name: str
    opened: Callable[[], TextIO]
    marked: Callable[[], TextIO] | None = None  # the same, with the mark U+FFFD for bytes that are not text

    @contextmanager
    def lines(self, marked: bool = False) -> Iterator[Iterator[str]]:
        """Open the text and iterate over its lines; bytes that are not text are refused, or `marked`.

        Raises DataError where they cannot be read, also during the iteration.
        """
        opener = self.marked if marked and self.marked is not None else self.opened
        try:
            with opener() as file:
                yield iter(file)
        except UnicodeError:
            raise DataError(f"{self.name}: contains bytes that are not text; save the file as CSV in UTF-8") from None
        except (OSError, EOFError, zlib.error) as error:
            raise DataError(f"{self.name}: cannot be read as text: {_reason(error)}") from None


def open_text_file(path: Path, garbled: bool = False) -> Source:
    """The file `path` as text; `garbled` allows a few bytes that are not text, as in a log from a wire.

    Raises DataError at once for a folder, a binary file, and a file that is too large.
    """
    if path.is_dir():
        raise DataError(f"{path}: cannot be read: Is a directory; name a file in it")
    try:
        size = path.stat().st_size
        if size > LARGEST_BYTES:
            raise DataError(
                f"{path}: the file has {size / 2**30:.1f} GiB; the limit is {LARGEST_BYTES >> 30} GiB; "
                "write the mean of each pose instead of samples, or fewer samples per pose"
            )
        with _bytes(path) as file:
            head = file.read(HEAD_BYTES)
    except (OSError, EOFError, zlib.error) as error:
        fault = "cannot be read as text" if _is_packed(path) else "cannot be read"
        raise DataError(f"{path}: {fault}: {_reason(error)}") from None
    encoding = _detect_encoding(head, path, MOST_GARBLED if garbled else 0.0)
    return Source(
        str(path),
        lambda: io.TextIOWrapper(_bytes(path), encoding=encoding),
        lambda: io.TextIOWrapper(_bytes(path), encoding=encoding, errors="replace"),
    )


def text_source(content: str, name: str) -> Source:
    """A text in memory as a source."""
    return Source(name, lambda: io.StringIO(content, newline=None))


def _bytes(path: Path) -> BinaryIO:
    return cast(BinaryIO, _Unpacked(path) if _is_packed(path) else path.open("rb"))


def _is_packed(path: Path) -> bool:
    """Whether a file is packed by gzip, by its name or its first bytes."""
    try:
        with path.open("rb") as file:
            return path.suffix == ".gz" or file.read(2) == b"\x1f\x8b"
    except OSError:
        return path.suffix == ".gz"


class _Unpacked(gzip.GzipFile):
    """A gzip file with limits on its unpacked size, also relative to its packed size, because numbers are held in
    memory before all lines are read; and on the length of a line, which is held in memory.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "rb")
        self._packed = path.stat().st_size
        self._taken = self._of_line = 0

    def read1(self, size: int = -1) -> bytes:
        """Read for the text decoder. Raises DataError beyond LARGEST_BYTES, and in a line beyond LONGEST_LINE_BYTES."""
        data = super().read1(size)
        self._taken += len(data)
        _, end, last_line = data.rpartition(b"\n")
        self._of_line = len(last_line) if end else self._of_line + len(data)
        if self._of_line > LONGEST_LINE_BYTES:
            most = LONGEST_LINE_BYTES >> 20
            raise DataError(f"{self.name}: a line has more than {most} MiB; is it really a CSV file?")
        if self._taken > max(SMALL_BYTES, LARGEST_RATIO * self._packed):
            raise DataError(
                f"{self.name}: the unpacked file is more than {LARGEST_RATIO} times larger, which is unusual for "
                "measurements; is it really a table? If it is, unpack it and import the unpacked file"
            )
        if self._taken > LARGEST_BYTES:
            raise DataError(
                f"{self.name}: holds more than {LARGEST_BYTES >> 30} GiB; unpack it and import a part of it"
            )
        return data


def _detect_encoding(head: bytes, path: Path, most_garbled: float) -> str:
    """The encoding by its byte-order mark; else UTF-8, then Excel's cp1252. Raises DataError for binary content.

    At most a share `most_garbled` of the bytes may be no text, below the first line.
    """
    for mark, encoding in MARKS.items():
        if head.startswith(mark):
            return encoding
    controls = [k for k, byte in enumerate(head) if byte in CONTROLS]
    if controls and (len(controls) > most_garbled * len(head) or controls[0] < len(head.splitlines()[0])):
        binary = controls[0]
        for first, content, remedy in KNOWN_BINARY:
            if head.startswith(first):
                raise DataError(f"{path}: is {content}, not text; {remedy}, and import the CSV file")
        raise DataError(
            f"{path}: is not text (byte {binary} is {head[binary]:#04x}); is it really a CSV file? "
            "From a spreadsheet, save the sheet as CSV"
        )
    for encoding in ("utf-8", "cp1252"):
        try:
            codecs.getincrementaldecoder(encoding)().decode(head)
        except UnicodeDecodeError:
            continue
        return encoding
    if head.decode("ascii", "replace").count("\ufffd") <= most_garbled * len(head):
        return "utf-8"
    raise DataError(f"{path}: is not text in UTF-8; is it really a CSV file? From a spreadsheet, save the sheet as CSV")


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


# YAML of other people: data only, and of limited size.
#
# The safe loader makes only numbers, texts, dates, lists and mappings. An alias repeats a part without a copy: nine
# levels of nine aliases are one page of text, but a billion parts for a program that visits all of them. The parts are
# therefore counted with their repetitions.

LONGEST_YAML = 1 << 18  # characters: the largest bench file has a hundredth of it
MOST_YAML_PARTS = 100_000


def load_yaml(text: str) -> Any:
    """The document in `text`. Raises ValueError for invalid YAML, a document that is too large, and one that contains
    itself.
    """
    return deepcopy(_document(text))


@lru_cache(maxsize=16)
def _document(text: str) -> Any:
    """The same, kept: a bench and a model are read again for each run, page and sensor of a batch."""
    if len(text) > LONGEST_YAML:
        raise ValueError(f"the document has {len(text)} characters; the limit is {LONGEST_YAML}")
    try:
        document = yaml.safe_load(text)
        _require_bounded(document)
    except RecursionError:
        raise ValueError("the document is nested too deeply") from None
    except (yaml.YAMLError, ArithmeticError, LookupError, TypeError, AttributeError) as error:
        raise ValueError(" ".join(str(error).split())) from None
    return document


def read_mapping(path: Path, file_kind: str, error: Callable[[str], Exception], example: str) -> dict[str, Any]:
    """The mapping in the YAML file `path`; `file_kind` names its kind, `example` is an instruction to get one.

    Raises `error` with the path, the kind and the reason.
    """
    try:
        document = load_yaml(path.read_text(encoding="utf-8"))
    except OSError as fault:
        raise error(f"{path}: cannot read the {file_kind}: {fault.strerror}; give another file") from None
    except ValueError as fault:
        raise error(f"{path}: the {file_kind} is not YAML: {fault}") from None
    if not isinstance(document, dict):
        raise error(f"{path}: the {file_kind} is not a mapping; {example}")
    return document


def _require_bounded(document: Any) -> None:
    """Raises ValueError for a document with too many parts; a part that an alias repeats counts each time."""
    sizes: dict[int, int | None] = {}  # of parts that are done; None while they are being counted

    def size(part: Any) -> int:
        if not isinstance(part, (dict, list)):
            return 1
        if id(part) not in sizes:
            sizes[id(part)] = None
            parts = [*part, *part.values()] if isinstance(part, dict) else part
            sizes[id(part)] = 1 + sum(map(size, parts))
        if (count := sizes[id(part)]) is None:
            raise ValueError("a part of the document contains itself")
        if count > MOST_YAML_PARTS:
            raise ValueError(
                f"the document has more than {MOST_YAML_PARTS} parts; do not use aliases that contain aliases"
            )
        return count

    size(document)
