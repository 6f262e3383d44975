"""Questions to a person, each of which accepts only what makes sense as its answer.

A question has a name, by which a file of answers or the record answers it, and a drawing where one helps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from procedures.errors import BadAnswer, nearest

EDGES = ("z", "x", "y")  # one stands along the table's normal, the next in turn lies along the table's x


@dataclass(frozen=True)
class Question:
    """`name` is its key in a file of answers; `drawing` names a picture of what is to be done, "" for none.

    An answer is asked for once a run, unless `repeated`: the same may have to be done again.
    """

    name: str
    text: str
    drawing: str = ""
    repeated: bool = False

    @property
    def accepts(self) -> str:
        """What an answer may be, for people."""
        return "a text"

    def checked(self, answer: str) -> str:
        """The answer as it is kept. Raises BadAnswer."""
        return answer.strip()

    def _refused(self, answer: str) -> BadAnswer:
        return BadAnswer(f"{self.name}: {answer!r} is no answer to {self.text!r}; it takes {self.accepts}")


@dataclass(frozen=True)
class Confirm(Question):
    """Something that a person has done or seen: yes or no."""

    @property
    def accepts(self) -> str:
        return "yes or no"

    def checked(self, answer: str) -> str:
        known = {"yes": "yes", "y": "yes", "true": "yes", "no": "no", "n": "no", "false": "no"}
        if (word := answer.strip().lower()) not in known:
            raise self._refused(answer)
        return known[word]


@dataclass(frozen=True)
class Mounting(Confirm):
    """The sensor is taken off and put back: turned by `mount_deg` about the table's normal, face down if `flip`.

    `up` is the edge that stands along the normal: on edge, the next one in turn lies along the table's x.
    """

    repeated: bool = True
    mount_deg: float = 0.0
    flip: int = 0
    up: str = "z"

    @staticmethod
    def of(mount_deg: float, flip: int, up: str = "z") -> Mounting:
        """The question for one way of mounting it."""
        side = "down" if flip else "up"
        if up != "z":
            along = EDGES[(EDGES.index(up) + 1) % 3]
            text = f"Does the sensor stand on edge, its {up} axis {side} and its {along} axis along the table's x"
            text += f", turned by {mount_deg:g} deg?" if mount_deg else "?"
            return Mounting(f"mount-{mount_deg:g}-{up}-{side}", text, "", mount_deg=mount_deg, flip=flip, up=up)
        text = f"Is the sensor mounted face {side}, turned by {mount_deg:g} deg about its z axis?"
        drawing = f"face-{side}"
        return Mounting(f"mount-{mount_deg:g}-{side}", text, drawing, mount_deg=mount_deg, flip=flip)


@dataclass(frozen=True)
class Number(Question):
    """A reading that a person types, in `unit`, from `low` to `high`."""

    unit: str = ""
    low: float = -math.inf
    high: float = math.inf

    @property
    def accepts(self) -> str:
        return f"a number from {self.low:g} to {self.high:g} {self.unit}".rstrip()

    def checked(self, answer: str) -> str:
        try:
            value = float(answer.strip().removesuffix(self.unit).strip().replace(",", "."))
        except ValueError:
            raise self._refused(answer) from None
        if not self.low <= value <= self.high:
            raise self._refused(answer)
        return repr(value)


@dataclass(frozen=True)
class Dial(Number):
    """What a person reads on `stage`, set to `expected` before, which yes or nothing stands for; None: only read."""

    repeated: bool = True
    stage: str = ""
    expected: float | None = None

    @property
    def accepts(self) -> str:
        if self.expected is None:
            return super().accepts
        return f"yes for {self.expected:g} {self.unit}, or {super().accepts}"

    def checked(self, answer: str) -> str:
        confirmed = answer.strip().lower() in ("", "yes", "y", "true")
        return super().checked(repr(self.expected) if confirmed and self.expected is not None else answer)


@dataclass(frozen=True)
class PowerCycle(Confirm):
    """The sensor is switched off by hand for `off_s` seconds, and on again."""

    repeated: bool = True
    off_s: float = 0.0


@dataclass(frozen=True)
class Remount(Confirm):
    """The sensor is taken off the table and put back the same way."""

    repeated: bool = True


@dataclass(frozen=True)
class Choice(Question):
    """One of `choices`."""

    choices: tuple[str, ...] = ()

    @property
    def accepts(self) -> str:
        return f"one of {', '.join(self.choices)}"

    def checked(self, answer: str) -> str:
        word = answer.strip()
        if word not in self.choices:
            raise BadAnswer(f"{self._refused(answer)}{nearest(word, self.choices)}")
        return word
