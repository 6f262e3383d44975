"""The link to a person: some instruments are set and read by hand.

A driver asks for a number, whoever answers: the program that runs the rig connects the person who is at it.
"""

from __future__ import annotations

from typing import Protocol

from drivers.errors import LinkRefused

PERSON = "person"  # the url of an instrument whose wire is a person


class Person(Protocol):
    """A person who follows instructions and reports readings."""

    def ask(self, name: str, text: str, unit: str, low: float, high: float, expected: float | None = None) -> float:
        """Ask for a reading in `unit`, between `low` and `high`. `name` is the question's key in a file of answers.

        A confirmation means the `expected` number. Without an answer, raises the error of the calling program.
        """


class PersonLink:
    """A link to the person at the rig."""

    def __init__(self) -> None:
        self.attended_by: Person | None = None

    def ask(self, name: str, text: str, unit: str, low: float, high: float, expected: float | None = None) -> float:
        """Ask the person for a number. Raises LinkRefused if no person is connected."""
        if self.attended_by is None:
            raise LinkRefused(f'no person is at the rig to answer "{text}"', "Ask within a run")
        return self.attended_by.ask(name, text, unit, low, high, expected)
