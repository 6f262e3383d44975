"""Who looks on while a procedure runs, and what they are told of its end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

from procedures.questions import Question
from procedures.session import Reading
from rig.planning.plan import Plan
from rig.record import Kept, Run

Wish = Literal["resume", "repeat", "end"]


class Watch(Protocol):
    """Who looks on: a terminal, a test, nobody."""

    def planned(self, plan: Plan) -> None:
        """All that a new run will do, before it begins. Raises Declined where a person does not want it."""

    def begun(self, run: str) -> None: ...
    def doing(self, text: str) -> None: ...
    def expect(self, total: int, done: int) -> None: ...
    def kept(self, kept: Kept) -> None: ...
    def read(self, reading: Reading) -> None: ...

    def ask(self, question: Question, instead: str | None) -> str:
        """A person's checked answer, or `instead` of one where nobody looks on. Raises NoAnswer where there is none."""

    def interrupted(self, outcome: Outcome) -> Wish:
        """The run does not go on and all stands still: resume it, repeat its last pose and go on, or end it."""


@dataclass(frozen=True)
class Outcome:
    """How a run ended: complete, stopped or failed; `error` says why it is not complete.

    `moving` names what could not be stopped.
    """

    run: Run
    error: Exception | None = None
    moving: tuple[str, ...] = ()
