"""The elements of a MATLAB file (version 5 to 7.2), checked before SciPy reads them.

SciPy takes types and lengths as the file states them: a damaged one ends the process, or gives numbers of other memory.
Source: MathWorks, MAT-File Format, chapter 1.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Literal, Protocol

HEADER_BYTES = 128
DEEPEST = 50  # of structs and cells: SciPy calls itself for each
MOST_DIMENSIONS = 32
MOST_PARTS = 1_000_000  # structs or cells of an array
PIECE_BYTES = 1 << 20
INT8, INT32, UINT32, MATRIX, COMPRESSED = 1, 5, 6, 14, 15
BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}  # of a number, by its type
CELL, STRUCT, OBJECT, CHAR, SPARSE, FUNCTION, OPAQUE = 1, 2, 3, 4, 5, 16, 17
NUMERIC = range(6, 16)
COMPLEX = 0x800  # of the flags


class Bytes(Protocol):
    """Bytes that are read once."""

    def read(self, size: int, /) -> bytes: ...


class Unpacked:
    """The bytes of a compressed element."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file, self._left, self._unpack = file, size, zlib.decompressobj()
        self._packed = self._bytes = b""

    def read(self, size: int, /) -> bytes:
        """The next `size` bytes; fewer at the end."""
        while len(self._bytes) < size:
            if not self._packed:
                self._packed = self._file.read(min(self._left, PIECE_BYTES))
                self._left = self._left - len(self._packed) if self._packed else 0
            piece = self._unpack.decompress(self._packed, max(PIECE_BYTES, size))
            self._packed = self._unpack.unconsumed_tail
            if not piece and not self._packed and not self._left:
                break
            self._bytes += piece
        taken, self._bytes = self._bytes[:size], self._bytes[size:]
        return taken


@dataclass
class Elements:
    """The elements of one variable, in their order. Raises ValueError for one that does not fit."""

    source: Bytes
    order: Literal["little", "big"]

    def matrix(self, depth: int = 0) -> None:
        """An array of any class, with its tag."""
        if depth > DEEPEST:
            raise ValueError(f"structs or cells are more than {DEEPEST} deep")
        kind, size, _ = self._tag()
        if kind != MATRIX:
            raise ValueError(f"an element of the type {kind} in the place of an array")
        if size == 0:
            return
        flags = self._number(self._element({UINT32}, 8)[:4])
        array_class = flags & 0xFF
        if array_class == OPAQUE:
            for _ in range(3):
                self._element({INT8})
            self.matrix(depth + 1)
            return
        dimensions = self._element({INT32})
        if len(dimensions) % 4 or not 8 <= len(dimensions) <= 4 * MOST_DIMENSIONS:
            raise ValueError(f"{len(dimensions)} bytes of dimensions")
        lengths = [self._number(dimensions[k : k + 4]) for k in range(0, len(dimensions), 4)]
        self._element({INT8})  # the name
        self._content(array_class, bool(flags & COMPLEX), math.prod(lengths), depth)

    def _content(self, array_class: int, is_complex: bool, count: int, depth: int) -> None:
        if array_class in (CELL, STRUCT, OBJECT) and count > MOST_PARTS:
            raise ValueError(f"an array of {count} structs or cells")
        if array_class in NUMERIC or array_class == CHAR:
            for _ in range(1 + is_complex):
                self._numbers(count)
        elif array_class == SPARSE:
            for _ in range(3 + is_complex):
                self._element(BYTES)
        elif array_class == CELL:
            for _ in range(count):
                self.matrix(depth + 1)
        elif array_class in (STRUCT, OBJECT):
            if array_class == OBJECT:
                self._element({INT8})
            length = self._number(self._element({INT32}, 4))
            names = len(self._element({INT8}))
            if not 0 < length <= 64 or names % length:
                raise ValueError(f"{names} bytes of field names of {length} bytes each")
            for _ in range(count * (names // length)):
                self.matrix(depth + 1)
        elif array_class == FUNCTION:
            self.matrix(depth + 1)
        else:
            raise ValueError(f"an array of the unknown class {array_class}")

    def _numbers(self, count: int) -> None:
        """The numbers of an array, as many as its dimensions say. A text may be coded in more bytes."""
        kind, size, small = self._tag()
        if kind not in BYTES:
            raise ValueError(f"numbers of the unknown type {kind}")
        if size != count * BYTES[kind] and kind != 16:
            raise ValueError(f"{size} bytes for {count} numbers of the type {kind}")
        self._skip(size, small)

    def _element(self, kinds: set[int] | dict[int, int], size: int | None = None) -> bytes:
        """The data of an element that must have one of these types, and this size."""
        kind, found, small = self._tag()
        if kind not in kinds or (size is not None and found != size):
            raise ValueError(f"an element of the type {kind} with {found} bytes")
        if small is not None:
            return small[:found]
        data = self._take(found)
        self._take(-found % 8)
        return data

    def _tag(self) -> tuple[int, int, bytes | None]:
        """Type and size of an element, and its four bytes of data if it is a small one."""
        first, rest = self._take(4), self._take(4)
        word = self._number(first)
        if size := word >> 16:
            if size > 4:
                raise ValueError(f"a small element of {size} bytes")
            return word & 0xFFFF, size, rest
        return word, self._number(rest), None

    def _skip(self, size: int, small: bytes | None) -> None:
        if small is None:
            left = size + -size % 8
            while left > 0:
                left -= len(self._take(min(left, PIECE_BYTES)))

    def _take(self, size: int) -> bytes:
        data = self.source.read(size)
        if len(data) < size:
            raise ValueError("it ends within an array")
        return data

    def _number(self, data: bytes) -> int:
        return int.from_bytes(data, self.order)


def require_sound(path: Path) -> None:
    """Raises ValueError for a file with an element that does not fit into its place."""
    with path.open("rb") as file:
        order: Literal["little", "big"] = "little" if file.read(HEADER_BYTES)[126:] == b"IM" else "big"
        while len(tag := file.read(8)) == 8:
            kind, size = int.from_bytes(tag[:4], order), int.from_bytes(tag[4:], order)
            begin = file.tell()
            if kind == COMPRESSED:
                Elements(Unpacked(file, size), order).matrix()
            elif kind == MATRIX:
                file.seek(begin - 8)
                Elements(file, order).matrix()
            else:
                raise ValueError(f"an element of the type {kind} in the place of a variable")
            file.seek(begin + size)
