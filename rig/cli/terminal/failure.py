"""The end of a failed command: one message on standard error and an exit status, no traceback.

0 done | 1 done, and a limit or check was not met | 2 bad usage or bad input
3 an instrument failed | 4 stopped by a person or a safety limit | 70 a fault of this program
"""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Callable
from typing import Any

import click

# Exit statuses by the name of the error class, so that nothing is imported. The most specific base class of an error
# counts; an error with its own attribute `exit_status` needs no line here.
STATUS = {
    "calibrations.errors.CalibrationError": 2,
    "calibrations.errors.UnusableData": 1,
    "procedures.errors.SafetyLimit": 4,
    "procedures.errors.Declined": 4,
    "procedures.errors.NoAnswer": 4,
    "procedures.errors.ProcedureError": 2,
    "drivers.errors.LimitError": 4,
    "drivers.errors.DriverError": 3,
}
PROGRAM_FAULT = 70
BROKEN_PIPE = 141  # as a shell reports SIGPIPE


def exit_status(call: Callable[[], Any]) -> int:
    """Run `call`; an integer that it returns is the status, else 0. Prints one message for an error."""
    try:
        returned = call()
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nothing more to flush to
        return BROKEN_PIPE
    except click.exceptions.Exit as end:  # such as after --help
        return end.exit_code
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except (KeyboardInterrupt, click.Abort):
        return _print("stopped", 4)
    except Exception as error:
        return _report_failure(error)
    return returned if isinstance(returned, int) else 0


def _report_failure(error: Exception) -> int:
    status = status_of(error)
    if os.environ.get("RIG_DEBUG"):
        traceback.print_exc()
    if isinstance(error, OSError) and error.strerror:
        return _print(_file_error_text(error), status)
    if status != PROGRAM_FAULT:
        return _print(str(error), status)
    text = f"{type(error).__name__}: {error}".rstrip(": ")
    return _print(f"a fault of this program: {text}. RIG_DEBUG=1 shows where.", status)


def status_of(error: BaseException) -> int:
    """The exit status of an error."""
    exit_status = getattr(error, "exit_status", None)
    if isinstance(exit_status, int):
        return exit_status
    for kind in type(error).__mro__:
        if (status := STATUS.get(f"{kind.__module__}.{kind.__qualname__}")) is not None:
            return status
    return 2 if isinstance(error, OSError) else PROGRAM_FAULT  # a file that cannot be read or written


def _file_error_text(error: OSError) -> str:
    """The message of an error of the operating system."""
    reason = (error.strerror or "").lower()
    if error.filename is None:
        return f"the operating system reports: {reason}; free the full or busy resource, and try again"
    return f"{error.filename}: cannot use the file: {reason}; check its name and permissions, or give another"


def _print(message: str, status: int) -> int:
    click.echo(f"rig: {message}", err=True)
    return status
