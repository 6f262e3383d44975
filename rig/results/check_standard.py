"""check-standard: bias and scale factor of the check standard, for its control chart."""

from __future__ import annotations

from calibrations.analyses.tumble import estimate_tumbles
from rig.record.measured import Measured
from rig.results.result import Result

AXES = "xy"
NAMES = ("bias-{axis}", "scale-{axis}")


def evaluate(measured: Measured) -> dict[str, Result]:
    """bias-x in the unit of the outputs and scale-x per g, the same of y; uncertainties by white noise alone.

    Raises DataError.
    """
    table, results = measured.table(), {}
    for axis in (axis for axis in table.axes if axis in AXES):
        (tumble,) = estimate_tumbles(table, axis)
        results[f"bias-{axis}"] = Result(tumble.bias_v, table.unit, tumble.bias_std_v)
        std = tumble.scale_std * abs(tumble.scale_v_per_g)
        results[f"scale-{axis}"] = Result(tumble.scale_v_per_g, f"{table.unit}/g", std)
    return results
