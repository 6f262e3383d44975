"""Faults of a wire: what becomes of the bytes that a simulated instrument says. One pure function each.

silence       hears nothing and says nothing      } what comes to the instrument is dropped,
disconnect    the connection is closed            } see server.Port
all others    a message becomes other messages, at other times; an empty one is the end of the connection
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from random import Random
from typing import NamedTuple

from drivers.manual_stage.person import PERSON
from drivers.transport.faults import Fault, Faults, Kind

END = b""  # as a read that finds nothing
MENDED_S = 0.2  # until TCP sends a spoilt segment again
BABBLE_S = 60.0  # how long it babbles for one message
MOST_PIECES = 1000  # of a message


class Said(NamedTuple):
    """A message of an instrument, and when its last byte is through."""

    data: bytes
    due_s: float


@dataclass(frozen=True)
class Wire:
    """What faults have to know of a wire.

    `mends` is whether it has checksums of its own, as TCP has. Where several units share it, `unit_of` tells whose a
    message is; `of_unit` is the same message of another unit.
    """

    mends: bool
    unit_of: Callable[[bytes], int | None] = lambda _: None
    of_unit: Callable[[bytes, int], bytes] = lambda data, _: bytes([(data[0] + 1) % 256]) + data[1:]


Effect = Callable[[Said, float, Wire], list[Said]]


def nothing(_said: Said, _size: float, _wire: Wire) -> list[Said]:
    """Nothing arrives."""
    return []


def the_end(said: Said, _size: float, _wire: Wire) -> list[Said]:
    """The connection ends where it would have come."""
    return [Said(END, said.due_s)]


def later(said: Said, size: float, _wire: Wire) -> list[Said]:
    """The same, `size` s later."""
    return [Said(said.data, said.due_s + size)]


def noise(said: Said, size: float, _wire: Wire) -> list[Said]:
    """So many other bytes; the same ones for the same message."""
    return [Said(Random(said.data).randbytes(int(size)), said.due_s)]  # noqa: S311 - nothing is secret


def babble(said: Said, size: float, wire: Wire) -> list[Said]:
    """A byte of noise every `size` s."""
    (long,) = noise(said, BABBLE_S / size, wire)
    return [Said(long.data[k : k + 1], said.due_s + k * size) for k in range(len(long.data))]


def truncated(said: Said, size: float, _wire: Wire) -> list[Said]:
    """The first `size` bytes of it."""
    return [Said(said.data[: int(size)], said.due_s)]


def merged(said: Said, _size: float, _wire: Wire) -> list[Said]:
    """The message and its copy in one piece."""
    return [Said(2 * said.data, said.due_s)]


def trickled(said: Said, size: float, _wire: Wire) -> list[Said]:
    """Byte by byte, one every `size` s; a long one in MOST_PIECES equal pieces."""
    step = -(-len(said.data) // MOST_PIECES)
    starts = range(0, len(said.data), step)
    return [Said(said.data[k : k + step], said.due_s + place * size) for place, k in enumerate(starts)]


def after_noise(said: Said, size: float, wire: Wire) -> list[Said]:
    """The message behind so many other bytes, in one piece."""
    return [Said(noise(said, size, wire)[0].data + said.data, said.due_s)]


def before_noise(said: Said, size: float, wire: Wire) -> list[Said]:
    """The message before so many other bytes, in one piece."""
    return [Said(said.data + noise(said, size, wire)[0].data, said.due_s)]


def flipped(said: Said, size: float, wire: Wire) -> list[Said]:
    """One bit turned over; on TCP the segment comes again."""
    if wire.mends:
        return later(said, MENDED_S, wire)
    byte, bit = divmod(int(size) % (8 * len(said.data)), 8)
    data = bytearray(said.data)
    data[byte] ^= 1 << bit
    return [Said(bytes(data), said.due_s)]


def other_unit(said: Said, size: float, wire: Wire) -> list[Said]:
    """The message of another unit; on a wire with one instrument, one about something else."""
    return [Said(wire.of_unit(said.data, (wire.unit_of(said.data) or 0) + int(size)), said.due_s)]


EFFECTS: dict[str, tuple[Kind, Effect]] = {
    "silence": (Kind("hears nothing and says nothing, as with a cable that is out"), nothing),
    "disconnect": (
        Kind("the connection is closed as soon as it is asked or would say something; it can be opened again"),
        the_end,
    ),
    "lost-answers": (Kind("hears and obeys, but nothing that it says arrives"), nothing),
    "delay": (Kind("all that it says comes later", 0.7, "s", least=0), later),
    "garbage": (Kind("says noise in place of what it should", 8, "byte", least=1), noise),
    "garbage-before": (Kind("so much noise comes before what it says", 3, "byte", least=1), after_noise),
    "garbage-after": (Kind("so much noise comes after what it says", 3, "byte", least=1), before_noise),
    "babble": (
        Kind("for each thing that it should say, a minute of noise, a byte each interval", 0.01, "s", least=0.001),
        babble,
    ),
    "truncated": (Kind("only the first bytes of what it says arrive", 4, "byte", least=1), truncated),
    "merged": (Kind("what it says comes together with a copy of it"), merged),
    "trickle": (Kind("what it says comes byte by byte, at this interval", 0.002, "s", least=0), trickled),
    "flipped-bit": (Kind("this bit is turned over in all that it says; TCP mends it", 13, "bit", least=0), flipped),
    "wrong-unit": (Kind("another unit answers, whose number is larger by this", 1), other_unit),
}


def disturbed(said: Said, faults: Faults, wire: Wire) -> list[Said]:
    """What becomes of a message."""
    messages = [said]
    for what, (_, effect) in EFFECTS.items() if faults else ():
        if (size := faults.size(what, said.due_s)) is not None:
            messages = [each for message in messages for each in _effect(effect, message, size, wire)]
    return messages


def _effect(effect: Effect, message: Said, size: float, wire: Wire) -> list[Said]:
    """What becomes of one message; of an end, nothing else."""
    return [message] if message.data == END else effect(message, size, wire)


def kinds_of(driver: str) -> dict[str, Kind]:
    """All faults that the twin of a driver can have, by name; those of a wire where it has one."""
    twin = importlib.import_module(f"drivers.{driver}.twin")
    own: dict[str, Kind] = getattr(twin, "FAULTS", {})
    return own if twin.LISTEN == PERSON else {what: kind for what, (kind, _) in EFFECTS.items()} | own


def faults_of(driver: str, faults: Iterable[Fault]) -> Faults:
    """The faults of a twin of `driver`. Raises KeyError for one that it cannot have."""
    return Faults(faults, kinds_of(driver))
