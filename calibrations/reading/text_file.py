"""A file of other people as text, a line at a time: its encoding as spreadsheets write them, gzip, and what is no text.

Nothing here holds a file as a whole, so that a log of hundreds of megabytes needs no memory beside its numbers.
"""

from __future__ import annotations

import codecs
import gzip
import io
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TextIO, cast

from calibrations.errors import DataError

LARGEST_BYTES = 1 << 30
HEAD_BYTES = 1 << 16
MARKS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
CONTROLS = frozenset(range(32)) - set(b"\t\n\r\f") - {0x1A}  # the last ends a text file in old Windows programs


@dataclass(frozen=True)
class Source:
    """A text that can be read again and again, and what messages call it."""

    name: str
    opened: Callable[[], TextIO]

    @contextmanager
    def lines(self) -> Iterator[Iterator[str]]:
        """Its lines. Raises DataError where they cannot be read, also while they are."""
        try:
            with self.opened() as file:
                yield iter(file)
        except UnicodeError:
            raise DataError(f"{self.name}: is not text throughout; save it as CSV in UTF-8") from None
        except (OSError, EOFError, zlib.error) as error:
            raise DataError(f"{self.name}: cannot be read as text: {_reason(error)}") from None


def text_file(path: Path) -> Source:
    """The file `path` as text. Raises DataError at once for a folder, and for what is too large or no text."""
    if path.is_dir():
        raise DataError(f"{path}: cannot be read: Is a directory; name a file in it")
    try:
        size = path.stat().st_size
        if size > LARGEST_BYTES:
            raise DataError(
                f"{path}: {size / 2**30:.1f} GiB are more than the {LARGEST_BYTES >> 30} GiB that are read; "
                "write the mean of each pose instead of samples, or fewer samples a pose"
            )
        with _bytes(path) as file:
            head = file.read(HEAD_BYTES)
    except (OSError, EOFError, zlib.error) as error:
        what = "cannot be read as text" if path.suffix == ".gz" else "cannot be read"
        raise DataError(f"{path}: {what}: {_reason(error)}") from None
    encoding = _encoding(head, path)
    return Source(str(path), lambda: io.TextIOWrapper(_bytes(path), encoding=encoding))


def text(content: str, name: str) -> Source:
    """A text at hand, as a file's."""
    return Source(name, lambda: io.StringIO(content, newline=None))


def _bytes(path: Path) -> BinaryIO:
    return cast(BinaryIO, _Unpacked(path) if path.suffix == ".gz" else path.open("rb"))


class _Unpacked(gzip.GzipFile):
    """A compressed file, of which no more comes than of a file that is not."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "rb")
        self._taken = 0

    def read1(self, size: int = -1) -> bytes:
        """As a text reader takes it. Raises DataError for more than LARGEST_BYTES in all."""
        data = super().read1(size)
        self._taken += len(data)
        if self._taken > LARGEST_BYTES:
            raise DataError(f"{self.name}: holds more than {LARGEST_BYTES >> 30} GiB; unpack it, and take a part of it")
        return data


def _encoding(head: bytes, path: Path) -> str:
    """As its mark says; UTF-8 where it is that; else that of Excel on Windows, cp1252. Raises DataError for bytes."""
    for mark, encoding in MARKS.items():
        if head.startswith(mark):
            return encoding
    binary = next((k for k, byte in enumerate(head) if byte in CONTROLS), None)
    if binary is not None:
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
    raise DataError(f"{path}: is not text in UTF-8; is it really a CSV file? From a spreadsheet, save the sheet as CSV")


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
