"""Identity and self-test of every instrument, and the abilities that some instruments have."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from drivers.errors import LimitError

# What to do after a value was refused; drivers and plans give the same advice.
OUTSIDE_ANGLE = "Ask for an angle within the limits, or change them in the bench file after checking the cables"
OUTSIDE_TEMPERATURE = "Ask for a temperature within the limits, or change them in the bench file"
OUTSIDE_POSITION = "Ask for positions within the limits; an oscillation goes half its width to each side of its centre"


@dataclass(frozen=True)
class Identity:
    """Identity of the instrument that answered. A field is empty where the instrument has no register for it."""

    model: str
    serial: str = ""
    firmware: str = ""


@dataclass(frozen=True)
class Check:
    """One line of a self-test."""

    name: str
    ok: bool
    detail: str


class Instrument(Protocol):
    """The common interface of stages, converters and ovens."""

    @property
    def name(self) -> str: ...

    def identify(self) -> Identity: ...

    def self_test(self) -> list[Check]: ...


@dataclass(frozen=True)
class Alarm:
    """A drive's alarm, its cause in words, and the remedy. `resettable`: a command can reset it after the remedy."""

    code: int
    text: str
    remedy: str
    resettable: bool

    @property
    def words(self) -> str:
        """Instructions for a person: remove the cause, then reset the alarm."""
        reset = "then reset the alarm with `rig check --reset`, or switch the drive off and on"
        return f"{self.remedy}; {reset if self.resettable else 'the alarm needs a power cycle'}"


@runtime_checkable
class HasAlarm(Protocol):
    """A drive that stops with an alarm, which a person resets."""

    def alarm(self) -> Alarm | None: ...

    def reset_alarm(self) -> None:
        """Raises StageAlarm if it stays."""


# Abilities of some instruments. Code that waits and the stop of the rig use them where they exist.


@runtime_checkable
class CanLook(Protocol):
    """An instrument with interlocks or alarms that need attention while the program waits."""

    def look(self) -> None:
        """Raises Interlocked or StageAlarm."""


@runtime_checkable
class CanHalt(Protocol):
    """An instrument that stops in two steps, so that others can stop at the same time."""

    def halt(self) -> None:
        """Send the stop command and return at once; `stop` must follow."""


@runtime_checkable
class KeepsSteady(Protocol):
    """An instrument that can compare its position or oscillation with the last command."""

    def require_steady(self) -> None:
        """Raises the error of a stage that has left its position, or of an oscillation that has ended."""


@runtime_checkable
class HasStopInput(Protocol):
    """A drive with a stop input that may still be on after a stop that failed."""

    def release(self) -> bool:
        """Switch the stop input off if it is on; returns whether it was on."""


@runtime_checkable
class CountsSamples(Protocol):
    """A digital sensor whose driver counts lost and damaged samples."""

    def tally(self) -> dict[str, tuple[float, str]]:
        """The counters since the connection, by name: a value with its unit."""


def require_positive(settings: object, *names: str) -> None:
    """Raises ValueError with the names of the settings that are not positive and finite."""
    if wrong_names := [name for name in names if not 0 < getattr(settings, name) < math.inf]:
        raise ValueError(f"{', '.join(wrong_names)} must be positive")


def require_range(settings: object, name: str) -> None:
    """Raises ValueError where the setting `name` is not a lower limit and an upper one."""
    low, high = getattr(settings, name)
    if not low < high:
        raise ValueError(f"{name} must be the lower limit, then the upper one")


def require_within(
    subject: str, value: float, limits: tuple[float, float], unit: str, remedy: str, effect: str = "nothing was sent"
) -> None:
    """Raises LimitError for a `value` outside its limits; NaN is outside as well."""
    low, high = limits
    if not low <= value <= high:
        limits_text = f"{value:g} {unit} is outside its limits {low:g} .. {high:g} {unit}"
        raise LimitError(f"{subject}{limits_text}; {effect}", remedy)
