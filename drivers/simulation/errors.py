"""What can go wrong in the simulated world.

SimulationError
├── UnknownSetting   a configuration names something that does not exist
├── BadSetting       a configuration value has the wrong type or no physical meaning
├── UnknownInput     a converter input or a stage axis that the world does not have
└── TimeReversal     the world was asked about a time that has passed
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class SimulationError(Exception):
    """Root of this room's errors."""


class UnknownSetting(SimulationError, ValueError):
    """A configuration names something that does not exist."""


class BadSetting(SimulationError, ValueError):
    """A configuration value has the wrong type or no physical meaning."""


class UnknownInput(SimulationError, KeyError):
    """A converter input or a stage axis that the world does not have."""

    def __str__(self) -> str:  # KeyError would print the message in quotes
        return str(self.args[0])


class TimeReversal(SimulationError, ValueError):
    """The world was asked about a time that has passed."""


def unknown(what: str, name: object, known: Iterable[str]) -> str:
    """One sentence: what is unknown, the nearest name, all names."""
    names = list(known)
    near = get_close_matches(str(name), names, n=1, cutoff=0.4)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return f"unknown {what} {name!r}: {hint}known are {', '.join(names)}"
