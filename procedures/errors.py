"""What a procedure can refuse or stop for.

ProcedureError
├── UnknownProcedure    no file of this name; names the nearest
├── SettingError        a setting that it does not have, of the wrong type, or out of range
├── BadAnswer           an answer that a question does not accept
├── NoAnswer            a question to a person that nobody is there to answer; the run stops and can be resumed
├── Declined            a person said no; the run stops and can be resumed
└── SafetyLimit         a limit of the bench was passed; the procedure stops
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class ProcedureError(Exception):
    """The message says what, where and what to do."""


class UnknownProcedure(ProcedureError):
    """No procedure of this name."""


class SettingError(ProcedureError):
    """A setting that the procedure does not have, or a value that it cannot have."""


class BadAnswer(ProcedureError):
    """An answer that the question does not accept."""


class NoAnswer(ProcedureError):
    """A question to a person that nobody is there to answer."""


class Declined(ProcedureError):
    """A person said no to what the procedure needs."""


class SafetyLimit(ProcedureError):
    """A measured value is outside the limits of the bench."""


def nearest(name: str, known: Iterable[str]) -> str:
    """The tail of a message about an unknown `name`: the nearest known one, else all there are."""
    known = list(known)
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"; did you mean {close[0]!r}?" if close else f"; there are: {', '.join(known)}"
