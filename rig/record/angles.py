"""The angles at which the poses of a run really were, as far as is known.

The record keeps what was commanded. A stage that is turned by hand was read, and what its dial showed counts; a stage's
error table, of the bench that the run was made with, gives the true angle. What was commanded stays in a column beside,
`alpha_set_deg`; the standard uncertainty of the angles is the constant `alpha_std_deg`, its mean square over the poses.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt
from typing import Any

import numpy as np

from calibrations.error_table import ErrorTable
from calibrations.table import Array
from rig.bench import TURNING, Instrument
from rig.record.values import Run

Columns = Mapping[str, Array]


def as_they_were(run: Run, columns: Columns) -> tuple[dict[str, Array], dict[str, float]]:
    """Columns with the angles of `run` put right, and the constants that say how sure they are.

    Raises DataError for an angle that an error table does not hold.
    """
    found, constants = dict(columns), {}
    for role in TURNING:
        if f"{role}_deg" not in found:
            continue
        read_deg = found.pop(f"{role}_read_deg", None)
        part = run.bench.get("instruments", {}).get(role)
        points = part and part.get("error_table")
        if read_deg is None and not points:
            continue
        shown_deg = found[f"{role}_deg"] if read_deg is None else read_deg
        variance = np.full(len(shown_deg), 0.0 if read_deg is None else _resolution_deg(part) ** 2 / 12)
        true_deg = shown_deg
        if points:
            true_deg, table_std_deg = ErrorTable(tuple(map(tuple, points))).true_deg(shown_deg)
            variance = variance + table_std_deg**2
        found |= {f"{role}_set_deg": found[f"{role}_deg"], f"{role}_deg": true_deg}
        constants[f"{role}_std_deg"] = sqrt(float(variance.mean()))
    return found, constants


def _resolution_deg(part: Mapping[str, Any]) -> float:
    """Of the dial of a stage that is turned by hand."""
    return float(Instrument.model_validate(part).typed_settings().resolution_deg)
