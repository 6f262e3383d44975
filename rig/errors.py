"""Errors of the application, with the exit status of the command.

RigError (2)             bad usage or bad input
├── BenchError           a fault in the bench file: file, key, suggestion
├── PlanError            the plan is not possible
├── RecordError          the record cannot be opened, or does not have the data
│   ├── UnknownRun       no run has this name; the message has a suggestion
│   └── LabAway          there is no connection to the lab's record
├── Busy                 another process uses this run or this instrument
├── BeyondLimits         the plan exceeds a limit of the bench
├── RunMismatch          the bench is not the bench of the run
├── ExportError          the export format is unknown, or does not fit the run
└── OutputError          a file cannot be written
InstrumentFailed (3)     there is no connection to an instrument, or it fails; with role, address and remedy
Stopped (4)              a person or a signal stopped the run; `rig resume` continues it
"""

from __future__ import annotations


class RigError(Exception):
    """Bad usage or bad input. The message names the fault, its place and the remedy."""

    exit_status = 2


class BenchError(RigError):
    """The bench file has a fault."""


class PlanError(RigError):
    """The plan is not possible."""


class RecordError(RigError):
    """The record cannot be opened, or does not have the data."""


class UnknownRun(RecordError):
    """The record has no run with this name."""


class LabAway(RecordError):
    """There is no connection to the lab's record."""


class Busy(RigError):
    """Another process uses this run or this instrument."""


class BeyondLimits(RigError):
    """The plan exceeds a limit of the bench, so a run would be refused or stopped."""


class RunMismatch(RigError):
    """The bench is not the bench of the run."""


class ExportError(RigError):
    """The run cannot be written in this format."""


class OutputError(RigError):
    """A file cannot be written."""


class InstrumentFailed(RigError):
    """There is no connection to an instrument, or it fails its check."""

    exit_status = 3


class Stopped(RigError):
    """A person or a signal stopped the run. `by` is the name of the signal: SIGINT is a person at the terminal."""

    exit_status = 4

    def __init__(self, message: str, by: str = "SIGINT") -> None:
        super().__init__(message)
        self.by = by
