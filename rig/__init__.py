"""The application: a bench, procedures, the record of runs, and analysis of what they measured.

import rig

table = rig.load("last sweep")
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from calibrations.table import Table

__all__ = ["load"]


def load(data: str) -> Table:
    """The table of a run or a file; a run by its id, the beginning of one, `last` or `last PROCEDURE`.

    Raises UnknownRun with a suggestion, RecordError, DataError naming file, line and column.
    """
    from rig.services.tables import load as load_table  # the command line imports `rig` for its help, too

    return load_table(data)
