"""How a failed command ends: one message on standard error and the contract's exit status, no traceback.

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

# The rooms' error trees, by name, so that nothing is imported for this. The most special class along an
# error's bases counts; an error with an `exit_status` of its own needs no line here.
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
    """Run `call`; its whole number, or 0, is the status. Any error is told in one message."""
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
        return _told("stopped", 4)
    except Exception as error:
        return _failed(error)
    return returned if isinstance(returned, int) else 0


def _failed(error: Exception) -> int:
    status = status_of(error)
    if os.environ.get("RIG_DEBUG"):
        traceback.print_exc()
    if isinstance(error, OSError) and error.strerror:
        return _told(_of_file(error), status)
    if status != PROGRAM_FAULT:
        return _told(str(error), status)
    text = f"{type(error).__name__}: {error}".rstrip(": ")
    return _told(f"a fault of this program: {text}. RIG_DEBUG=1 shows where.", status)


def status_of(error: BaseException) -> int:
    """The exit status that belongs to `error`."""
    own = getattr(error, "exit_status", None)
    if isinstance(own, int):
        return own
    for kind in type(error).__mro__:
        if (status := STATUS.get(f"{kind.__module__}.{kind.__qualname__}")) is not None:
            return status
    return 2 if isinstance(error, OSError) else PROGRAM_FAULT  # a file that cannot be read or written


def _of_file(error: OSError) -> str:
    """What the operating system refused, with the file and what to do."""
    what = (error.strerror or "").lower()
    if error.filename is None:
        return f"the operating system refuses: {what}; free what is full or busy, and try again"
    return f"{error.filename}: cannot be used: {what}; check its name and its permissions, or name another"


def _told(message: str, status: int) -> int:
    click.echo(f"rig: {message}", err=True)
    return status
