"""Errors of this library: wrong data, models, effects and expressions.

CalibrationError
├── DataError            a table: its file, line and column
│   ├── MissingColumn    a column that the question needs
│   ├── MissingConstant  a number that the rows do not contain
│   ├── TooFewRows       fewer rows than parameters
│   └── UnusableData     an output that does not respond, two sensors in one table, exchanged channels
├── ModelError           a model file: its key
│   └── ExpressionError  an effect written as an expression: its column
└── UnknownName          a model or an effect that does not exist; names the nearest
    └── UnknownParameter a key that a model has no parameter for
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class CalibrationError(Exception):
    """Bad input to the library; the message gives problem, place and remedy."""


class DataError(CalibrationError):
    """A table does not fit its declared kind."""


class MissingColumn(DataError):
    """A column that is needed is not there."""


class MissingConstant(DataError):
    """A constant that is needed is not given; `likely` is the value that the file suggests, None without one."""

    def __init__(self, message: str, name: str, likely: float | None = None) -> None:
        super().__init__(message)
        self.name, self.likely = name, likely


class TooFewRows(DataError):
    """Fewer rows than the model has parameters."""


class UnusableData(DataError):
    """Outputs that contradict the stated mounting of the sensor, so that there is no result."""


class ModelError(CalibrationError):
    """A model file cannot be read, or does not fit the data."""


class ExpressionError(ModelError):
    """An effect's expression cannot be read, or has no finite value on the data."""


class UnknownName(CalibrationError):
    """A name that is not in its list."""


class UnknownParameter(UnknownName, KeyError):
    """A key, such as bias.x, for which a model has no parameter."""

    __str__ = Exception.__str__  # KeyError puts the message into quotes


def nearest(name: str, known_names: Iterable[str]) -> str:
    """A hint `; did you mean "..."?` with the nearest known name, or the known names if none is near."""
    known_names = sorted(known_names)
    close = difflib.get_close_matches(name, known_names, n=1, cutoff=0.5)
    if close:
        return f'; did you mean "{close[0]}"?'
    return f"; known: {', '.join(known_names)}" if known_names else ""
