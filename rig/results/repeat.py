"""repeat: standard deviation of bias and scale factor between repetitions of each kind, without their noise."""

from __future__ import annotations

from calibrations.analyses.stability import repeatability
from calibrations.analyses.tumble import estimate_tumbles
from rig.record.measured import Measured
from rig.results.result import Missing, Result

AXES = "xy"
NAMES = tuple(f"{quantity}-{kind}-{{axis}}" for quantity in ("bias", "scale") for kind in ("as-is", "power", "mount"))


def evaluate(measured: Measured) -> dict[str, Result | Missing]:
    """bias-as-is-x in the unit of the outputs, scale-power-y as a fraction, and so on.

    Raises DataError for fewer than two repetitions.
    """
    table, results = measured.table(), dict[str, Result | Missing]()
    for axis in (axis for axis in table.axes if axis in AXES):
        tumbles = estimate_tumbles(table, axis)
        for kind in dict.fromkeys(tumble.path.partition(" ")[0] for tumble in tumbles):
            of_kind = [tumble for tumble in tumbles if tumble.path.partition(" ")[0] == kind]
            bias = repeatability([t.bias_v for t in of_kind], [t.bias_std_v for t in of_kind])
            mean = sum(t.scale_v_per_g for t in of_kind) / len(of_kind)
            scale = repeatability([t.scale_v_per_g / mean for t in of_kind], [t.scale_std for t in of_kind])
            results[f"bias-{kind}-{axis}"] = _result(bias, table.unit)
            results[f"scale-{kind}-{axis}"] = _result(scale, "")
    return results


def _result(estimate: tuple[float, float | None], unit: str) -> Result | Missing:
    """A spread with its standard uncertainty; Missing without one, because a spread of 0 would pass any limit."""
    spread, std = estimate
    if std is None:
        return Missing("all repetitions are equal and their noise is unknown; record more digits or more samples")
    return Result(spread, unit, std)
