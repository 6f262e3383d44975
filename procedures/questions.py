"""Questions to a person. A question checks its answer.

A file of answers and the record find the answer by the question's name. Some questions have a drawing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.errors import did_you_mean
from procedures.errors import BadAnswer

EDGES = ("z", "x", "y")  # if one axis is along the table's normal, the next one in this cycle is along the table's x


@dataclass(frozen=True)
class Question:
    """`name` is the key in a file of answers. `drawing` is the name of a picture of the work, "" for none.

    A run asks a question once, unless it is `repeated`: then the work may be needed again.
    """

    name: str
    text: str
    drawing: str = ""
    repeated: bool = False

    @property
    def accepts(self) -> str:
        """The accepted answers, in words."""
        return "a text"

    def checked(self, answer: str) -> str:
        """The answer in the form for the record. Raises BadAnswer."""
        return answer.strip()

    def _bad_answer(self, answer: str, hint: str = "") -> BadAnswer:
        remedy = f"answer with {self.accepts}{hint}"
        return BadAnswer(
            f"{self.name}: {answer!r} does not answer {self.text!r}; {remedy}",
            f"{answer!r} is not a valid answer; {remedy}",
        )


@dataclass(frozen=True)
class Confirm(Question):
    """A confirmation by a person: yes or no."""

    @property
    def accepts(self) -> str:
        return "yes or no"

    def checked(self, answer: str) -> str:
        words = {"yes": "yes", "y": "yes", "true": "yes", "no": "no", "n": "no", "false": "no"}
        if (word := answer.strip().lower()) not in words:
            raise self._bad_answer(answer)
        return words[word]


@dataclass(frozen=True)
class Mounting(Confirm):
    """A new mounting of the sensor: turned by `mount_deg` about the table's normal, face down if `flip`.

    `up` is the sensor's axis along the normal. If it is not z, the next axis of EDGES is along the table's x.
    """

    repeated: bool = True
    mount_deg: float = 0.0
    flip: int = 0
    up: str = "z"

    @staticmethod
    def of(mount_deg: float, flip: int, up: str = "z") -> Mounting:
        """The question for one mounting."""
        side = "down" if flip else "up"
        if up != "z":
            edge = EDGES[(EDGES.index(up) + 1) % 3]
            text = f"Does the sensor stand on edge, its {up} axis {side} and its {edge} axis along the table's x"
            text += f", turned by {mount_deg:g} deg?" if mount_deg else "?"
            return Mounting(f"mount-{mount_deg:g}-{up}-{side}", text, "", mount_deg=mount_deg, flip=flip, up=up)
        text = f"Is the sensor mounted face {side}, turned by {mount_deg:g} deg about its z axis?"
        drawing_name = f"face-{side}"
        return Mounting(f"mount-{mount_deg:g}-{side}", text, drawing_name, mount_deg=mount_deg, flip=flip)


@dataclass(frozen=True)
class Number(Question):
    """A number that a person reads and types, in `unit`, from `low` to `high`."""

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
            raise self._bad_answer(answer) from None
        if not self.low <= value <= self.high:
            raise self._bad_answer(answer)
        return repr(value)


@dataclass(frozen=True)
class Dial(Number):
    """The reading of the dial of `stage`. An empty answer or yes means `expected`; None: there is only a reading."""

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
    """A person switches the sensor off for `off_s` seconds, then on."""

    repeated: bool = True
    off_s: float = 0.0


@dataclass(frozen=True)
class Remount(Confirm):
    """A person takes the sensor off the table and mounts it again in the same way."""

    repeated: bool = True


@dataclass(frozen=True)
class Choice(Question):
    """One of `choices`, or the beginning of one that no other choice has."""

    choices: tuple[str, ...] = ()

    @property
    def accepts(self) -> str:
        return f"one of {', '.join(self.choices)}"

    def checked(self, answer: str) -> str:
        word = answer.strip().lower()
        begun = [choice for choice in self.choices if word and choice.startswith(word)]
        if word in self.choices or len(begun) == 1:
            return word if word in self.choices else begun[0]
        raise self._bad_answer(answer, f".{did_you_mean(word, (), self.choices)}")
