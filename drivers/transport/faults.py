"""Faults of simulated instruments: their kinds, their times and durations.

A fault of the link happens between the connections of a server and its twins, so every twin can have all of them. The
faults of an instrument itself belong to its twin: the twin's module declares them by name as `FAULTS`, and the twin
reads its `faults`.

A fault begins at a time of the simulated clock or after a number of requests, and lasts a time or a number of requests.
With a `probability` it is present at random: drawn from its `seed`, the time and the number of requests, so the same
run has it at the same times. Its state is a part of the state of the server: a resumed run has the same faults as an
uninterrupted one.
"""

from __future__ import annotations

import importlib
import itertools
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from random import Random
from typing import Any, NamedTuple

from drivers.transport.person import PERSON


@dataclass(frozen=True)
class Fault:
    """A fault from `at_s` on for `for_s`, and after the first `after` requests for `times` requests.

    Times are those of the simulated clock. None means without end; a `size` of None is the usual one of its kind. With
    a `probability` below 1 it is present only at some of these times, by the `seed`.
    Raises ValueError for an impossible time or number.
    """

    what: str
    at_s: float = 0.0
    for_s: float | None = None
    after: int = 0
    times: int | None = None
    size: float | None = None
    probability: float = 1.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not (0 <= self.at_s < math.inf and self.after >= 0):
            raise ValueError("at_s and after must not be negative")
        if (self.for_s is not None and not self.for_s > 0) or (self.times is not None and self.times < 1):
            raise ValueError("for_s and times must be positive")
        if not 0 < self.probability <= 1:
            raise ValueError("probability must be above 0, and at most 1")
        if self.size is not None and not math.isfinite(self.size):
            raise ValueError("size must be a number")

    def happens(self, *moment: float) -> bool:
        """Whether it is present at this moment, by its probability."""
        draw = f"{self.what} {self.seed} {moment}"
        return self.probability == 1 or Random(draw).random() < self.probability  # noqa: S311 - nothing is secret

    def has_begun(self, now_s: float, requests: int) -> bool:
        """Whether it has begun at `now_s`, after this number of `requests` to its instrument."""
        return now_s >= self.at_s and (self.after == 0 or requests > self.after)

    def has_ended(self, now_s: float, requests: int) -> bool:
        """Whether the fault has ended at this time."""
        in_time = self.for_s is None or now_s < self.at_s + self.for_s
        return not (in_time and (self.times is None or requests <= self.after + self.times))


@dataclass(frozen=True)
class Kind:
    """A fault that a bench can have: its description, its usual size and its meaning, and the least size."""

    doc: str
    size: float = 0.0
    unit: str = ""
    least: float = -math.inf

    def refusal(self, size: float | None) -> str | None:
        """The reason why it cannot have this size; None if it can."""
        if size is None or (self.size and size >= self.least):
            return None
        return (
            f"must be at least {self.least:g} {self.unit}".rstrip()
            if self.size
            else "this fault has no size; remove it"
        )


class Strike(NamedTuple):
    """A fault that happens once: its size, and when."""

    size: float
    at_s: float


class Faults:
    """The faults of one instrument, and their state."""

    def __init__(self, faults: Iterable[Fault] = (), kinds: Mapping[str, Kind] | None = None) -> None:
        """`kinds` are all possible faults. Raises KeyError for another one."""
        self._faults = [(f, (kinds or {})[f.what].size if f.size is None else f.size) for f in faults]
        self._request_count = 0
        self._struck: list[int] = []
        self._repeated_values: dict[str, Any] = {}

    def __bool__(self) -> bool:
        return bool(self._faults)

    def asked(self) -> None:
        """Count a request."""
        self._request_count += 1

    def size(self, name: str, now_s: float) -> float | None:
        """The size of a fault that is present now, otherwise None."""
        for fault, size in self._faults:
            active = fault.has_begun(now_s, self._request_count) and not fault.has_ended(now_s, self._request_count)
            if fault.what == name and active and fault.happens(now_s, self._request_count):
                return size
        return None

    def once(self, name: str, now_s: float) -> Strike | None:
        """A fault that has begun and is not reported yet."""
        for k, (fault, size) in enumerate(self._faults):
            is_new = k not in self._struck and fault.has_begun(now_s, self._request_count)
            if fault.what == name and is_new and fault.happens(self._request_count):
                self._struck.append(k)
                return Strike(size, now_s if fault.after else fault.at_s)
        return None

    def held(self, name: str, now_s: float, value: Any) -> Any:
        """`value`, of a type that JSON has; during the fault, the value at its beginning."""
        if self.size(name, now_s) is None:
            self._repeated_values.pop(name, None)
            return value
        return self._repeated_values.setdefault(name, value)

    def state(self) -> dict[str, Any]:
        """The state that a resumed run needs, JSON-able."""
        return {"asked": self._request_count, "struck": list(self._struck), "held": dict(self._repeated_values)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from `state`."""
        self._request_count, self._struck, self._repeated_values = (
            state["asked"],
            list(state["struck"]),
            dict(state["held"]),
        )


# Faults of a link: each is a function of the bytes that a simulated instrument sends.


END = b""  # as the read of a closed connection
RESEND_S = 0.2  # until TCP sends a damaged segment again
BABBLE_S = 60.0  # duration of the babble for one message
MOST_PIECES = 1000  # of a message


class Message(NamedTuple):
    """A message of an instrument, and the time of its last byte."""

    data: bytes
    due_s: float


@dataclass(frozen=True)
class Wire:
    """The properties of a link that faults need.

    `mends`: the link has its own checksums, as TCP. If several units share it, `unit_of` gives the unit of a message,
    and `of_unit` the same message of another unit.
    """

    mends: bool
    unit_of: Callable[[bytes], int | None] = lambda _: None
    of_unit: Callable[[bytes, int], bytes] = lambda data, _: bytes([(data[0] + 1) % 256]) + data[1:]


Effect = Callable[[Message, float, Wire], list[Message]]


def drop_message(_message: Message, _size: float, _wire: Wire) -> list[Message]:
    """Drop the message: nothing arrives."""
    return []


def close_connection(sent: Message, _size: float, _wire: Wire) -> list[Message]:
    """The connection closes in place of the answer."""
    return [Message(END, sent.due_s)]


def later(sent: Message, size: float, _wire: Wire) -> list[Message]:
    """The message, `size` s later."""
    return [Message(sent.data, sent.due_s + size)]


def noise(sent: Message, size: float, _wire: Wire) -> list[Message]:
    """`size` random bytes; equal for equal messages."""
    return [Message(Random(sent.data).randbytes(int(size)), sent.due_s)]  # noqa: S311 - nothing is secret


def babble(sent: Message, size: float, wire: Wire) -> list[Message]:
    """A byte of noise every `size` s."""
    (long,) = noise(sent, BABBLE_S / size, wire)
    return [Message(long.data[k : k + 1], sent.due_s + k * size) for k in range(len(long.data))]


def truncate(sent: Message, size: float, _wire: Wire) -> list[Message]:
    """The first `size` bytes of the message."""
    return [Message(sent.data[: int(size)], sent.due_s)]


def join_copy(sent: Message, _size: float, _wire: Wire) -> list[Message]:
    """The message and its copy in one piece."""
    return [Message(2 * sent.data, sent.due_s)]


def trickle(sent: Message, size: float, _wire: Wire) -> list[Message]:
    """Byte by byte, one every `size` s; a long one in MOST_PIECES equal pieces."""
    step = -(-len(sent.data) // MOST_PIECES)
    starts = range(0, len(sent.data), step)
    return [Message(sent.data[k : k + step], sent.due_s + place * size) for place, k in enumerate(starts)]


def after_noise(sent: Message, size: float, wire: Wire) -> list[Message]:
    """`size` random bytes and the message, in one piece."""
    return [Message(noise(sent, size, wire)[0].data + sent.data, sent.due_s)]


def before_noise(sent: Message, size: float, wire: Wire) -> list[Message]:
    """The message and `size` random bytes, in one piece."""
    return [Message(sent.data + noise(sent, size, wire)[0].data, sent.due_s)]


def flip_bit(sent: Message, size: float, wire: Wire) -> list[Message]:
    """Invert one bit; TCP sends the segment again."""
    if wire.mends:
        return later(sent, RESEND_S, wire)
    byte, bit_number = divmod(int(size) % (8 * len(sent.data)), 8)
    data = bytearray(sent.data)
    data[byte] ^= 1 << bit_number
    return [Message(bytes(data), sent.due_s)]


def other_unit(sent: Message, size: float, wire: Wire) -> list[Message]:
    """A message of another unit; on a link with one instrument, a message with other content."""
    return [Message(wire.of_unit(sent.data, (wire.unit_of(sent.data) or 0) + int(size)), sent.due_s)]


EFFECTS: dict[str, tuple[Kind, Effect]] = {
    "silence": (Kind("receives and sends nothing, as with an unplugged cable"), drop_message),
    "disconnect": (
        Kind("closes the connection at the next message; it can be opened again"),
        close_connection,
    ),
    "lost-answers": (Kind("executes commands, but its answers are lost"), drop_message),
    "delay": (Kind("its answers come late", 0.7, "s", least=0), later),
    "garbage": (Kind("sends random bytes instead of an answer", 8, "byte", least=1), noise),
    "garbage-before": (Kind("random bytes come before its answer", 3, "byte", least=1), after_noise),
    "garbage-after": (Kind("random bytes come after its answer", 3, "byte", least=1), before_noise),
    "babble": (
        Kind("sends random bytes for a minute instead of an answer, one each interval", 0.01, "s", least=0.001),
        babble,
    ),
    "truncated": (Kind("only the first bytes of its answer arrive", 4, "byte", least=1), truncate),
    "merged": (Kind("its answer arrives twice in one piece"), join_copy),
    "trickle": (Kind("its answer arrives byte by byte, at this interval", 0.002, "s", least=0), trickle),
    "flipped-bit": (Kind("this bit of every answer is inverted; TCP corrects it", 13, "bit", least=0), flip_bit),
    "wrong-unit": (Kind("another unit answers; its number is larger by this", 1), other_unit),
}


def disturb(sent: Message, faults: Faults, wire: Wire) -> list[Message]:
    """The message after the faults of this moment."""
    messages = [sent]
    for name, (_, effect) in EFFECTS.items() if faults else ():
        if (size := faults.size(name, sent.due_s)) is not None:
            parts = ([m] if m.data == END else effect(m, size, wire) for m in messages)
            messages = list(itertools.chain.from_iterable(parts))
    return messages


def kinds_of(driver: str) -> dict[str, Kind]:
    """All faults of the twin of a driver by name, with the faults of the link if it has one."""
    twin = importlib.import_module(f"drivers.{driver}.twin")
    own_faults: dict[str, Kind] = getattr(twin, "FAULTS", {})
    return own_faults if twin.LISTEN == PERSON else {name: kind for name, (kind, _) in EFFECTS.items()} | own_faults


def faults_of(driver: str, faults: Iterable[Fault]) -> Faults:
    """`faults` of a twin of `driver`. Raises KeyError for a fault that this twin cannot have."""
    return Faults(faults, kinds_of(driver))
