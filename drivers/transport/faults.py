"""Faults of simulated instruments: what goes wrong, when, and for how long.

A fault of the wire happens between a server's connections and its twins, so every twin has them all (see wire_faults).
A fault of the instrument itself is its twin's own: a twin module declares them by name as `FAULTS`, and a twin that has
any looks into its `faults`.

A fault begins at a time of the simulated clock or after so many requests, and lasts a time or a number of requests.
With a `probability` it is there now and then: drawn from its `seed`, the time and the number of requests, so that the
same run meets it at the same moments. What it has to remember is part of its server's state: a resumed run meets it
as an undisturbed one would.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from random import Random
from typing import Any, NamedTuple


@dataclass(frozen=True)
class Fault:
    """What goes wrong, from `at_s` on for `for_s`, and from the request after the first `after` on for `times` of them.

    Times are the simulated clock's. None is for ever; a `size` of None is the usual one of its kind. Each time that it
    could be there it is, with a `probability` of less than 1 only now and then, as the `seed` has it.
    Raises ValueError for a time or a number that cannot be.
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
        """Whether it is there at this moment, as its probability has it."""
        draw = f"{self.what} {self.seed} {moment}"
        return self.probability == 1 or Random(draw).random() < self.probability  # noqa: S311 - nothing is secret

    def has_begun(self, now_s: float, asked: int) -> bool:
        """Whether it is there by `now_s`, when its instrument has been asked `asked` times."""
        return now_s >= self.at_s and (self.after == 0 or asked > self.after)

    def has_ended(self, now_s: float, asked: int) -> bool:
        """Whether it has gone by then."""
        in_time = self.for_s is None or now_s < self.at_s + self.for_s
        return not (in_time and (self.times is None or asked <= self.after + self.times))


@dataclass(frozen=True)
class Kind:
    """A fault that can be asked for: what it does, its usual size, what that is a size of, and the least size."""

    doc: str
    size: float = 0.0
    unit: str = ""
    least: float = -math.inf

    def refusal(self, size: float | None) -> str | None:
        """Why it cannot have this size; None where it can."""
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
    """The faults of one instrument, and what they have to remember."""

    def __init__(self, faults: Iterable[Fault] = (), kinds: Mapping[str, Kind] | None = None) -> None:
        """`kinds` are all that it can have. Raises KeyError for another one."""
        self._faults = [(f, (kinds or {})[f.what].size if f.size is None else f.size) for f in faults]
        self._asked = 0
        self._struck: list[int] = []
        self._held: dict[str, Any] = {}

    def __bool__(self) -> bool:
        return bool(self._faults)

    def asked(self) -> None:
        """Count a request."""
        self._asked += 1

    def size(self, what: str, now_s: float) -> float | None:
        """The size of a fault that is there now; None where it is not."""
        for fault, size in self._faults:
            there = fault.has_begun(now_s, self._asked) and not fault.has_ended(now_s, self._asked)
            if fault.what == what and there and fault.happens(now_s, self._asked):
                return size
        return None

    def once(self, what: str, now_s: float) -> Strike | None:
        """A fault that has begun and has not been told yet."""
        for k, (fault, size) in enumerate(self._faults):
            begun = k not in self._struck and fault.has_begun(now_s, self._asked)
            if fault.what == what and begun and fault.happens(self._asked):
                self._struck.append(k)
                return Strike(size, now_s if fault.after else fault.at_s)
        return None

    def held(self, what: str, now_s: float, value: Any) -> Any:
        """`value`, which is JSON-able; as long as the fault is there, the one that it began with."""
        if self.size(what, now_s) is None:
            self._held.pop(what, None)
            return value
        return self._held.setdefault(what, value)

    def state(self) -> dict[str, Any]:
        """What a resumed run needs, JSON-able."""
        return {"asked": self._asked, "struck": list(self._struck), "held": dict(self._held)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from `state`."""
        self._asked, self._struck, self._held = state["asked"], list(state["struck"]), dict(state["held"])
