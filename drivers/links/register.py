"""A register, declared: where it is, how its words are read, and what one count is worth."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Kind = Literal["int16", "uint16", "int32", "uint32", "float32"]
CODES: dict[Kind, str] = {"int16": ">h", "uint16": ">H", "int32": ">i", "uint32": ">I", "float32": ">f"}


@dataclass(frozen=True)
class Register:
    """One value in an instrument's table; 32-bit values take two words, the high word first.

    `scale` is the value of one count in `unit`; a value is always in `unit`, words are as on the wire.
    """

    address: int
    kind: Kind
    doc: str
    unit: str = ""
    scale: float = 1.0

    def __str__(self) -> str:
        return f"register 0x{self.address:04X} ({self.doc})"

    @property
    def count(self) -> int:
        """Number of 16-bit words."""
        return struct.calcsize(CODES[self.kind]) // 2

    def decode(self, words: Sequence[int]) -> float:
        """The value of `words`, in `unit`."""
        raw = struct.unpack(CODES[self.kind], struct.pack(f">{self.count}H", *words))[0]
        return float(raw) * self.scale

    def encode(self, value: float) -> list[int]:
        """The words of `value`, rounded to the nearest count. Raises ValueError when it does not fit."""
        raw = value / self.scale
        try:
            packed = struct.pack(CODES[self.kind], raw if self.kind == "float32" else round(raw))
        except (struct.error, OverflowError) as error:
            raise ValueError(f"{value:g} {self.unit} does not fit into {self}") from error
        return list(struct.unpack(f">{self.count}H", packed))
