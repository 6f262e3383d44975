"""repeat: standard deviations of bias and scale factor between repetitions of each kind, beyond their noise."""

from __future__ import annotations

from calibrations.analyses.stability import repeatability
from calibrations.analyses.tumble import estimate_tumbles
from rig.record.measured import Measured
from rig.results.result import Missing, Result

AXES = "xy"
NAMES = tuple(f"{quantity}-{kind}-{{axis}}" for quantity in ("bias", "scale") for kind in ("as-is", "power", "mount"))


def evaluate(measured: Measured) -> dict[str, Result | Missing]:
    """bias-as-is-x, scale-power-y and so on: V, and a fraction. Raises DataError for fewer than two repetitions."""
    table, results = measured.table(), dict[str, Result | Missing]()
    for axis in (axis for axis in table.axes if axis in AXES):
        done = estimate_tumbles(table, axis)
        for kind in dict.fromkeys(each.path.partition(" ")[0] for each in done):
            mine = [each for each in done if each.path.partition(" ")[0] == kind]
            bias = repeatability([each.bias_v for each in mine], [each.bias_std_v for each in mine])
            mean = sum(each.scale_v_per_g for each in mine) / len(mine)
            scale = repeatability([each.scale_v_per_g / mean for each in mine], [each.scale_std for each in mine])
            results[f"bias-{kind}-{axis}"] = _result(bias, "V")
            results[f"scale-{kind}-{axis}"] = _result(scale, "")
    return results


def _result(found: tuple[float, float | None], unit: str) -> Result | Missing:
    """A spread of zero without an uncertainty would pass any limit."""
    spread, std = found
    if std is None:
        return Missing("all repetitions are equal and their noise is unknown; record more digits or more samples")
    return Result(spread, unit, std)
