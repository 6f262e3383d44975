"""Errors of instruments.

    DriverError
    ├── LimitError         a value outside its limits was refused; nothing was sent
    │   └── NotWired       an output that no input of the converter is wired to
    ├── LinkError          the wire
    │   ├── LinkRefused    it cannot be opened, or the other side closed it
    │   ├── LinkTimeout    silence
    │   ├── BadFrame       bytes that are not an answer: CRC, length, function code
    │   ├── WrongUnit      another unit of the bus answered
    │   └── Refused        the instrument understood and declined: a Modbus exception, a GCS error
    ├── InstrumentError    the instrument
    │   ├── StageAlarm     the drive stands still with an alarm
    │   ├── StageLost      the stage has lost its coordinates
    │   ├── Interlocked    an emergency stop or a guard is open, or a limit of the drive itself is not the one set
    │   ├── NotSettled     the stage did not arrive
    │   ├── StreamError    scans were lost, or packets are not the requested ones
    │   ├── OverRange      the converter was at an end of its range
    │   ├── OverTemperature  the oven is hotter than its limit
    │   └── SensorFault    the thermometer gives no temperature, the displacement sensor no distance; an output is stuck
    └── ClockStuck         a simulated instrument's bytes never arrived: a bound in real time, a defect of ours

Each message gives what happened, where (instrument and register), and what to do.
"""

from __future__ import annotations

from collections.abc import Iterable


class DriverError(Exception):
    """An error of an instrument: `what` happened, and the `remedy` as an instruction to a person."""

    def __init__(self, what: str, remedy: str) -> None:
        remedy = remedy.strip().removesuffix(".")
        super().__init__(f"{what}. {remedy}{'' if remedy.endswith('?') else '.'}")
        self.what = what
        self.remedy = remedy


class LimitError(DriverError):
    """A value outside its limits; nothing was sent."""


class NotWired(LimitError):
    """An output that no input of the converter is wired to."""


class LinkError(DriverError):
    """A fault of the link, not of the instrument."""


class LinkRefused(LinkError):
    """The link cannot be opened, or the other side closed it."""


class LinkTimeout(LinkError):
    """No answer arrived in time."""


class BadFrame(LinkError):
    """The received bytes are not a valid answer."""


class WrongUnit(LinkError):
    """A valid answer from another unit."""


class Refused(LinkError):
    """A Modbus exception answer or a GCS error; `code` is its number."""

    def __init__(self, what: str, remedy: str, code: int) -> None:
        super().__init__(what, remedy)
        self.code = code


class InstrumentError(DriverError):
    """The instrument itself reports or shows a fault."""


class StageAlarm(InstrumentError):
    """The drive's alarm; `code` is its number."""

    def __init__(self, what: str, remedy: str, code: int) -> None:
        super().__init__(what, remedy)
        self.code = code


class StageLost(InstrumentError):
    """The stage has lost its coordinates; it is not moved blindly."""


class Interlocked(InstrumentError):
    """A safety device prevents motion: an open contact, a stop input, a limit that the drive has not accepted."""

    exit_status = 4  # a safety limit


class NotSettled(InstrumentError):
    """The stage is not in position."""


class StreamError(InstrumentError):
    """The record has a gap, or is not the requested one."""


class OverRange(InstrumentError):
    """Samples at an end of the converter's range: the voltage is not known."""


class OverTemperature(InstrumentError):
    """The oven is hotter than its contents may become."""

    exit_status = 4  # a safety limit


class SensorFault(InstrumentError):
    """A thermometer without a temperature, a displacement sensor without a distance, an output that is stuck.

    `since_s`: time on the clock since when its values are wrong; None if no earlier value is.
    """

    def __init__(self, what: str, remedy: str, since_s: float | None = None) -> None:
        super().__init__(what, remedy)
        self.since_s = since_s


class ClockStuck(DriverError):
    """Bytes in flight to or from a simulated instrument did not arrive within a bound in real time."""


def did_you_mean(name: object, known_names: Iterable[str], unlisted: Iterable[str] = ()) -> str:
    """The end of a message about an unknown `name`, after a space: the most similar known name, else all known names.

    `unlisted`: names of another kind, which are only suggested.
    """
    import difflib

    choices = sorted(known_names)
    if similar := difflib.get_close_matches(str(name), [*choices, *unlisted], n=1, cutoff=0.5):
        return f" Did you mean {similar[0]!r}?"
    return f" There are: {', '.join(choices)}." if choices else ""
