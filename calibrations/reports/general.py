"""The general calibration in the report: M, S and b with their uncertainties, and what of the model is not in them."""

from __future__ import annotations

from typing import Any

from calibrations.fit import Fit
from calibrations.general import general
from calibrations.numerals import measured, unit

AXES = "xyz"


def section(found: Fit) -> dict[str, Any] | None:
    """Numbers and words of the section; None for a sensor with fewer than three axes, and for a motion."""
    made = general(found)
    if made is None:
        return None
    rows = [
        {
            "axis": axis,
            "M": [measured(float(value), float(std)) for value, std in zip(made.M[k], made.M_std[k], strict=True)],
            "S": measured(float(made.S[k]), float(made.S_std[k])),
            "b": measured(float(made.b[k]), float(made.b_std[k])),
        }
        for k, axis in enumerate(AXES)
    ]
    units = {"raw": unit(found.table.unit), "calibrated": unit(made.unit)}
    return {"rows": rows, **units, "beyond": ", ".join(made.beyond)}
