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
    """Of each axis:

    gyro-bias                V, the output at rest under no specific force
    gyro-scale               V/(deg/s)
    gyro-misalignment-xy     deg, what x feels of a turn about y, as a sine
    gyro-g-sensitivity-xy    (deg/s)/g, what x shows of a specific force along y
    rate-residual            deg/s, rms of what the four leave over all turns and rests

    The earth's rotation is taken off where the bench knows its latitude. Of an axis that was not asked to be turned
    about there is no scale factor, and no misalignment of the others towards it.
    """
    table = measured.table()
    found = fitted(table, "gyroscope", "gyro-misalignment", "gyro-g-sensitivity")
    results = {f"gyro-bias-{e.axis}": result(e) for e in found.model.estimates("gyro-bias")}
    scales = {e.axis: e for e in found.model.estimates("gyro-scale-factor")}
    results |= {f"gyro-scale-{axis}": result(scale) for axis, scale in scales.items()}
    results |= {f"gyro-misalignment-{e.name}": result(e) for e in found.model.estimates("gyro-misalignment")}
    left = dict(zip(found.channels, rms(found.residual), strict=True))
    for axis, scale in scales.items():
        if scale.identified and scale.value:
            for e in (e for e in found.model.estimates("gyro-g-sensitivity") if e.axis == axis):
                results[f"gyro-g-sensitivity-{axis}{e.name}"] = result(e, "(deg/s)/g", scale.value)
            results[f"rate-residual-{axis}"] = Result(abs(float(left[axis]) / scale.value), "deg/s")
    whole = measured.run.settings["mounts"] == len(EDGES)
    return {name: each for name, each in results.items() if whole or isinstance(each, Result)}
