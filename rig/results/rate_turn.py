"""rate-turn: bias, scale factor, misalignment and sensitivity to specific force of a gyroscope."""

from __future__ import annotations

from itertools import permutations

from calibrations.means.noise import rms
from procedures.questions import EDGES
from rig.record.measured import Measured
from rig.results.result import Missing, Result, fitted, result

AXES = "xyz"
PAIRS = tuple(own + other for own, other in permutations(AXES, 2))
NAMES = (
    *("gyro-bias-{axis}", "gyro-bias-rate-{axis}", "gyro-scale-{axis}", "rate-residual-{axis}"),
    *(f"gyro-misalignment-{pair}" for pair in PAIRS),
    *(f"gyro-g-sensitivity-{own}{other}" for own in AXES for other in AXES),
)


def evaluate(measured: Measured) -> dict[str, Result | Missing]:
    """For each axis:

    gyro-bias                output at rest without specific force, in the unit of the outputs
    gyro-scale               that unit per deg/s
    gyro-misalignment-xy     deg, response of x to a turn about y, as an arc sine
    gyro-g-sensitivity-xy    (deg/s)/g, sensitivity of x to a specific force along y
    rate-residual            deg/s, rms residual of the four over all turns and rests

    The rotation of the earth is subtracted if the bench has its latitude. An axis without a turn about it has no scale
    factor, and the other axes have no misalignment towards it.
    """
    table = measured.table()
    fit = fitted(table, "gyroscope", "gyro-misalignment", "gyro-g-sensitivity")
    results = {f"gyro-bias-{e.axis}": result(e) for e in fit.model.estimates("gyro-bias")}
    scales = {e.axis: e for e in fit.model.estimates("gyro-scale-factor")}
    results |= {f"gyro-scale-{axis}": result(scale) for axis, scale in scales.items()}
    results |= {f"gyro-misalignment-{e.name}": result(e) for e in fit.model.estimates("gyro-misalignment")}
    left = dict(zip(fit.channels, rms(fit.residual), strict=True))
    for axis, scale in scales.items():
        if scale.identified and scale.value:
            for e in (e for e in fit.model.estimates("gyro-g-sensitivity") if e.axis == axis):
                results[f"gyro-g-sensitivity-{axis}{e.name}"] = result(e, "(deg/s)/g", scale.value)
            results[f"rate-residual-{axis}"] = Result(abs(float(left[axis]) / scale.value), "deg/s")
    whole = measured.run.settings["mounts"] == len(EDGES)
    return {name: value for name, value in results.items() if whole or isinstance(value, Result)}
