"""temperature-cycle: temperature coefficients of bias and scale factor, and their hysteresis."""

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
    """Slopes of the bias per K, in the unit of the outputs, and of the scale factor in 1/K; hysteresis (up minus down)
    in the unit of the outputs and as a fraction. Raises DataError for too few steps."""
    table, results = measured.table(), {}
    for axis in (axis for axis in table.axes if axis in AXES):
        steps = estimate_tumbles(table, axis)
        for name, unit, coefficients in (
            ("bias", table.unit, bias_coefficients(steps)),
            ("scale", "", scale_coefficients(steps)),
        ):
            slope, slope_std = coefficients.slope
            results[f"{name}-temperature-{axis}"] = Result(slope, f"{unit or '1'}/K", slope_std)
            hysteresis, std = coefficients.hysteresis
            results[f"{name}-temperature-hysteresis-{axis}"] = Result(hysteresis, unit, std)
    return results
