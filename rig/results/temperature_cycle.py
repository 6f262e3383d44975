"""temperature-cycle: what temperature does to bias and scale factor, and what it leaves behind."""

from __future__ import annotations

from calibrations.analyses.tumble import bias_coefficients, estimate_tumbles, scale_coefficients
from rig.record.measured import Measured
from rig.results.result import Result

AXES = "xy"
NAMES = (
    *("bias-temperature-{axis}", "bias-temperature-hysteresis-{axis}"),
    *("scale-temperature-{axis}", "scale-temperature-hysteresis-{axis}"),
)


def evaluate(measured: Measured) -> dict[str, Result]:
    """Slopes in V/K and 1/K; hysteresis (up minus down) in V and as a fraction. Raises DataError for too few steps."""
    table, results = measured.table(), {}
    for axis in (axis for axis in table.axes if axis in AXES):
        steps = estimate_tumbles(table, axis)
        for name, unit, found in (
            ("bias", "V", bias_coefficients(steps)),
            ("scale", "", scale_coefficients(steps)),
        ):
            results[f"{name}-temperature-{axis}"] = Result(found.slope[0], f"{unit or '1'}/K", found.slope[1])
            hysteresis, std = found.hysteresis
            results[f"{name}-temperature-hysteresis-{axis}"] = Result(hysteresis, unit, std)
    return results
