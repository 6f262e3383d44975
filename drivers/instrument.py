"""Identity and self-test of every instrument."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True)
class Identity:
    """Who answered. A field is empty where the instrument has no register for it."""

    model: str
    serial: str = ""
    firmware: str = ""


@dataclass(frozen=True)
class Check:
    """One line of a self-test."""

    name: str
    ok: bool
    detail: str


class Instrument(Protocol):
    """The part that is the same for stages, converters and ovens."""

    @property
    def name(self) -> str: ...

    def identify(self) -> Identity: ...

    def self_test(self) -> list[Check]: ...

    def close(self) -> None: ...
