"""check-standard: bias and scale factor of the check standard, the points of its control chart."""

from __future__ import annotations

from calibrations.analyses.tumble import estimate_tumbles
from rig.record.measured import Measured
from rig.results.result import Result

AXES = "xy"
NAMES = ("bias-{axis}", "scale-{axis}")


def evaluate(measured: Measured) -> dict[str, Result]:
    """bias-x in V, scale-x in V/g, and so on; the standard errors are those of white noise. Raises DataError."""
    table, results = measured.table(), {}
    for axis in (axis for axis in table.axes if axis in AXES):
        (done,) = estimate_tumbles(table, axis)
        results[f"bias-{axis}"] = Result(done.bias_v, "V", done.bias_std_v)
        results[f"scale-{axis}"] = Result(done.scale_v_per_g, "V/g", done.scale_std * abs(done.scale_v_per_g))
    return results
