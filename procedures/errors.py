"""Errors of procedures.

ProcedureError
├── UnknownProcedure    no procedure has this name; the message has a suggestion
├── NoInstrument        the bench has no instrument in a role that the procedure needs
├── SettingError        an unknown setting, or a value with the wrong type or out of range
├── BadAnswer           the question does not accept this answer
├── NoAnswer            nobody is there to answer a question; the run stops and can be resumed
├── Declined            a person answered no; the run stops and can be resumed
└── SafetyLimit         a measured value is outside a limit of the bench; the procedure stops
"""

from __future__ import annotations


class ProcedureError(Exception):
    """The message says what is wrong, where, and what to do."""


class UnknownProcedure(ProcedureError):
    """No procedure of this name."""


class NoInstrument(ProcedureError):
    """The bench has no instrument in this role."""


class SettingError(ProcedureError):
    """The procedure does not have this setting, or the setting does not take this value."""


class BadAnswer(ProcedureError):
    """The question does not accept this answer. `beside`: the message for a reader who sees the question."""

    def __init__(self, message: str, beside: str = "") -> None:
        super().__init__(message)
        self.beside = beside or message


class NoAnswer(ProcedureError):
    """Nobody is there to answer a question."""


class Declined(ProcedureError):
    """A person answered no to a question that the procedure needs a yes to."""


class SafetyLimit(ProcedureError):
    """A measured value is outside a limit of the bench."""
