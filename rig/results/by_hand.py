"""Results of sensors in a hand: hand-positions, hand-fields and hand-turns."""

from __future__ import annotations

import math
from typing import NamedTuple

from calibrations.analyses import hand_fields as fields
from calibrations.analyses import hand_turns as turns
from calibrations.analyses.hand_positions import ANGLES, fit_positions, largest_uncertainty_g
from calibrations.geometry.sphere import magnetometer_coverage_warning
from calibrations.means.noise import rms
from rig.bench.result_names import RESULTS
from rig.record.measured import MeasuredRun
from rig.results.result import Missing, Result, ellipsoid, estimates, evaluates, gyroscope, result


class Target(NamedTuple):
    """The setting with the wanted uncertainty, its unit, and the unit in which a message shows it."""

    setting: str
    unit: str
    factor: float
    shown_unit: str


# An uncertainty from a dozen positions has a relative error of some tenths itself. The uncertainty that ends the run
# uses the noise at rest; that of the result uses the noise of each position. They differ by a tenth.
MOST_OVER_TARGET = 1.2

TARGET_G = Target("target_g", "g", 1e3, "mg")
TARGET_PERCENT = Target("target_percent", "%", 1.0, "%")


@evaluates("hand-positions")
def hand_positions(measured: MeasuredRun) -> dict[str, Result | Missing]:
    """From all positions together, by the magnitude of gravity:

    bias                 output without specific force, in the unit of the outputs
    scale                that unit per g
    nonorthogonality-xy  deg, departure of the angle between two sensing axes from 90 deg
    uncertainty          g, the largest standard uncertainty of these as an error at 1 g

    The uncertainty is Missing if it is above 1.2 times the setting target_g: the run ended at most_positions.
    """
    fit = fit_positions(measured.table())
    results = estimates(fit, "bias", "scale-factor", ANGLES)
    worst_g, parameter = largest_uncertainty_g(fit)
    reached = f"{parameter}: standard uncertainty {1e3 * worst_g:.3g} mg"
    return results | _uncertainty(measured, worst_g, reached, "positions", TARGET_G)


@evaluates("hand-fields")
def hand_fields(measured: MeasuredRun) -> dict[str, Result | Missing]:
    """From all positions together, by the magnitude of the field:

    hard-iron          of each axis, in the unit of the outputs
    soft-iron          relative, as in the effect soft-iron
    field-total        the strength of the field, in the unit of the outputs
    left-by-ellipsoid  rms residual of the magnitude, per mille of the field
    uncertainty        %, the largest standard uncertainty of these as a share of the field

    The uncertainty is Missing if it is above 1.2 times the setting target_percent, and if the field differs from
    position to position: then it contains iron that does not turn with the sensor.
    """
    table = measured.table()
    if reason := magnetometer_coverage_warning(table):
        return {name: Missing(reason) for name in RESULTS["hand-fields"]}
    fit = fields.fit_fields(table)
    (strength,) = fit.model.estimates("field-strength")
    results = ellipsoid(fit) | {"field-total": result(strength)}
    if doubt := fields.field_doubt(fit):
        remedy = "move away from it and repeat the run, or leave out the pose with `rig exclude`"
        return results | {"uncertainty": Missing(f"{doubt}; {remedy}")}
    worst, parameter = fields.largest_uncertainty(fit)
    reached = f"{parameter}: standard uncertainty {100 * worst:.2g} % of the field"
    return results | _uncertainty(measured, 100 * worst, reached, "positions", TARGET_PERCENT)


@evaluates("hand-turns")
def hand_turns(measured: MeasuredRun) -> dict[str, Result | Missing]:
    """From all turns together, by the direction of gravity before and after each:

    gyro-bias             output at rest, in the unit of the outputs
    gyro-scale            that unit per deg/s
    gyro-misalignment-xy  deg, response of x to a turn about y, as an arc sine; the axes are those of the accelerometer
    turn-residual         deg/s, rms residual of the turns: the error of their angles over their duration
    uncertainty           %, the largest standard uncertainty of a scale factor, or of a misalignment in rad

    The uncertainty is Missing if it is above 1.2 times the setting target_percent: the run ended at most_positions.
    """
    fit = turns.fit_turns(measured.table())
    results = gyroscope(fit)
    results |= {"turn-residual": Result(float(rms(fit.residual)[:2].max()), "deg/s")}
    worst, parameter = turns.largest_uncertainty(fit)
    reached = f"{parameter}: standard uncertainty {100 * worst:.2g} %"
    return results | _uncertainty(measured, 100 * worst, reached, "turns", TARGET_PERCENT)


def _uncertainty(
    measured: MeasuredRun, value: float, reached: str, rows: str, target: Target
) -> dict[str, Result | Missing]:
    """The result `uncertainty`, in the unit of the target; Missing well above it. `reached`: it in words."""
    goal = float(measured.run.settings.get(target.setting, math.inf))
    if value <= MOST_OVER_TARGET * goal:
        return {"uncertainty": Result(value, target.unit)}
    shown = f"{target.factor * goal:g} {target.shown_unit}"
    return {"uncertainty": Missing(f"{reached}, target {shown}; take more {rows}, or longer rests")}
