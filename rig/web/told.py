"""What the program says, on a page: its sentences with their signs, its errors as one message.

A message says what, where and what to do; what the program did wrong is said to be its fault.
"""

from __future__ import annotations

import logging
import re

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


def for_page(text: str) -> str:
    """A sentence of the command line with the signs that a terminal may not have: −, ±, ×, °C."""
    signs = re.sub(r"(?<![\w.)\]-])-(?=\d)", "−", text.replace(" +- ", " ± "))
    return re.sub(r"(?<=\d) x (?=the |that |its )", " × ", re.sub(r"(?<=\d) (deg)?C\b", " °C", signs))
