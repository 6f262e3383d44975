"""Errors as one message for a person: what, where, what to do. What the program did wrong is said to be its fault."""

from __future__ import annotations

import logging

from calibrations.errors import CalibrationError
from drivers.errors import DriverError
from procedures.errors import ProcedureError
from rig.errors import RigError

KNOWN = (CalibrationError, ProcedureError, DriverError, RigError)


def message(error: Exception) -> str:
    """What went wrong; a fault of the program goes to the server's log as well."""
    if isinstance(error, KNOWN):
        return str(error)
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename or 'a file'}: cannot be used: {error.strerror.lower()}"
    logging.getLogger("rig.web").error("a fault of this program", exc_info=error)
    return f"A fault of this program: {type(error).__name__}: {error}. The terminal of `rig web` shows where."
