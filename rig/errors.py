"""What can go wrong in the application itself; each error carries the exit status that the contract gives it.

RigError (2)             bad usage or bad input
├── BenchError           the bench file: file, key and nearest key
├── PlanError            a plan that cannot be made as asked
├── RecordError          the record cannot be opened, or does not hold what is asked
│   ├── UnknownRun       no run of this name; names the nearest
│   └── LabAway          the lab's record cannot be reached, or not any more
├── Busy                 another process works on this run, or with this instrument
├── BeyondLimits         what is planned would pass a limit of the bench
├── RunMismatch          the bench is not the one that the run was begun with
├── ExportError          a format that is not there, or does not fit the run
└── OutputError          a file cannot be written where it is wanted
InstrumentFailed (3)     an instrument cannot be reached or fails; names role, address and remedy
Stopped (4)              a person or a signal stopped the run, which `rig resume` finishes
"""

from __future__ import annotations


class RigError(Exception):
    """Bad usage or bad input; the message says what, where and what to do."""

    exit_status = 2


class BenchError(RigError):
    """The bench file cannot be used as it is."""


class PlanError(RigError):
    """No plan can be made as asked."""


class RecordError(RigError):
    """The record cannot be opened or does not hold what is asked."""


class UnknownRun(RecordError):
    """No run of this name is in the record."""


class LabAway(RecordError):
    """The lab's record cannot be reached, or not any more."""


class Busy(RigError):
    """Another process works on this run, or with this instrument."""


class BeyondLimits(RigError):
    """What is planned would pass a limit of the bench; a run of it would be refused or stopped."""


class RunMismatch(RigError):
    """The bench is not the one that the run was begun with."""


class ExportError(RigError):
    """The run cannot be written in this format."""


class OutputError(RigError):
    """A result cannot be written to this file."""


class InstrumentFailed(RigError):
    """An instrument cannot be reached, or fails its check."""

    exit_status = 3


class Stopped(RigError):
    """A person or a signal stopped the run; `by` is the signal's name: SIGINT is a person at the terminal."""

    exit_status = 4

    def __init__(self, message: str, by: str = "SIGINT") -> None:
        super().__init__(message)
        self.by = by
