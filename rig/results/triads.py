"""Results of sensors with three axes on a stage: rate-turn and magnetometer-turn."""

from __future__ import annotations

from math import hypot

import numpy as np

from calibrations.analyses.magnetometer_turn import (
    Elements,
    ExtremesEstimate,
    field_elements,
    iron_by_extremes,
    level_elements_by_extremes,
)
from calibrations.errors import DataError
from calibrations.fitting.fit import Fit
from calibrations.fitting.matrices import calibration_matrices
from calibrations.geometry.sphere import magnetometer_coverage_warning
from calibrations.means.noise import rms, white_std
from calibrations.table import Array, Table
from procedures.questions import EDGES
from procedures.session import Pose
from rig.bench.result_names import SOFT_IRON_PAIRS
from rig.record.measured import MeasuredRun, sensor_from_base
from rig.results.result import Missing, Result, ellipsoid, evaluates, fit_shipped, gyroscope, result

AXES = "xyz"


@evaluates("rate-turn")
def rate_turn(measured: MeasuredRun) -> dict[str, Result | Missing]:
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
    fit = fit_shipped(table, "gyroscope", "gyro-misalignment", "gyro-g-sensitivity")
    results = gyroscope(fit)
    scales = {e.axis: e for e in fit.model.estimates("gyro-scale-factor")}
    residuals = dict(zip(fit.channels, rms(fit.residual), strict=True))
    known_scales = {axis: scale.value for axis, scale in scales.items() if scale.identified and scale.value}
    for e in sorted(fit.model.estimates("gyro-g-sensitivity"), key=lambda e: e.axis):
        if e.axis in known_scales:
            results[f"gyro-g-sensitivity-{e.axis}{e.name}"] = result(e, "(deg/s)/g", known_scales[e.axis])
    for axis, scale in known_scales.items():
        results[f"rate-residual-{axis}"] = Result(abs(float(residuals[axis]) / scale), "deg/s")
    complete = measured.run.settings["mounts"] == len(EDGES)
    return {name: value for name, value in results.items() if complete or isinstance(value, Result)}


ELEMENTS = {"F": "field-total", "H": "field-horizontal", "D": "field-azimuth", "I": "field-inclination"}
HEADING = "heading_deg"
DECLINATION = "field-declination"


@evaluates("magnetometer-turn")
def magnetometer_turn(measured: MeasuredRun) -> dict[str, Result | Missing]:
    """By an ellipsoid fit to all directions (equations of Book 17):

    hard-iron                of each axis, in the unit of the outputs
    soft-iron                relative, as in the effect soft-iron
    left-by-ellipsoid        rms residual of the magnitude, per mille of the field
    field-total, -horizontal F and H, in that unit    (17.6)
    field-azimuth            deg from the x axis of the base, clockwise from above
    field-declination        D, deg from true north, if the bench has the `heading_deg` of the base    (17.9)
    field-inclination        I, deg below the horizontal    (17.10)

    and by hand, from the extremes of each turn, (17.11)-(17.15):

    hard-iron-by-hand        in the unit of the outputs
    soft-iron-by-hand        smallest over largest radius of the turn about z
    soft-iron-angle-by-hand  deg from x to its major axis, from -90 to 90
    left-by-hand             variation of the corrected magnitude, per mille
    field-horizontal-by-hand, field-azimuth-by-hand    from the turn about z

    The uncertainties by hand include the errors of this method: the vertical field that iron turns into the horizontal
    axes (unless the sensor was turned over), the effect of iron on H, and the steps between positions. The azimuth has
    an uncertainty only with several turns, because one turn does not show how the sensor sits in its mount.

    The results of the ellipsoid are Missing if the directions cover too little of the sphere. Raises DataError without
    the turn about z.
    """
    table, poses = measured.table(), [recorded.pose for recorded in measured.kept()]
    if poses[0].up != "z":
        raise DataError(
            f"run {measured.name} has no pose of the turn about z: all are excluded; take them in again with rig "
            "exclude --include"
        )
    names, std = [p.path for p in poses], _std(table)
    extremes = iron_by_extremes(table.outputs, [p.up for p in poses], names, std)
    reason = magnetometer_coverage_warning(table)
    by_ellipsoid = _missing_results(reason) if reason else _ellipsoid_results(table, poses)
    level = [k for k, pose in enumerate(poses) if pose.path == poses[0].path]  # the turn about z, upward, is first
    attitudes = np.array([sensor_from_base(poses[k]) for k in level])
    azimuth = by_ellipsoid[ELEMENTS["D"]]
    std_deg = azimuth.std if isinstance(azimuth, Result) else None
    turn_std_deg = None if std_deg is None else std_deg * len(set(names)) ** 0.5
    return by_ellipsoid | _extremes_results(
        extremes, level_elements_by_extremes(table.outputs[level], attitudes, turn_std_deg), std, table.unit
    )


def _std(table: Table) -> float:
    """Standard deviation of the mean at one position, in the unit of the outputs; 0 for single samples."""
    white = white_std(table)
    return 0.0 if white is None else float(np.sqrt(np.mean(white**2)))


def _missing_results(reason: str) -> dict[str, Result | Missing]:
    iron = (*(f"hard-iron-{axis}" for axis in AXES), *(f"soft-iron-{pair}" for pair in SOFT_IRON_PAIRS))
    return {name: Missing(reason) for name in (*iron, *ELEMENTS.values(), "left-by-ellipsoid")}


def _ellipsoid_results(table: Table, poses: list[Pose]) -> dict[str, Result | Missing]:
    fit = fit_shipped(table, "magnetometer")
    return ellipsoid(fit) | _elements(fit, table, poses)


def _elements(fit: Fit, table: Table, poses: list[Pose]) -> dict[str, Result | Missing]:
    calibration = calibration_matrices(fit)
    if calibration is None:
        return {name: Missing("the ellipsoid gives no calibration") for name in ELEMENTS.values()}
    (strength,) = fit.model.estimates("field-strength")
    attitudes: Array = np.array([sensor_from_base(pose) for pose in poses])
    turned = field_elements(strength.value * calibration(table.outputs), attitudes, [p.path for p in poses])
    units = {"F": table.unit, "H": table.unit, "D": "deg", "I": "deg"}
    results: dict[str, Result | Missing] = {}
    for name, value in turned.value.items():
        std = turned.std[name]
        of_strength = (strength.std or 0.0) * value / strength.value if name in "FH" else 0.0
        results[ELEMENTS[name]] = Result(value, units[name], None if std is None else hypot(std, of_strength))
        if name == "D" and HEADING in table.constants:
            from_north = (value + table.number(HEADING, 0.0) + 180) % 360 - 180
            results[DECLINATION] = Result(from_north, "deg", std)
    return results


def _extremes_results(
    extremes: ExtremesEstimate, level: Elements, noise: float, unit: str
) -> dict[str, Result | Missing]:
    results: dict[str, Result | Missing] = {}
    for name, unit_of_element in (("H", unit), ("D", "deg")):
        results[f"{ELEMENTS[name]}-by-hand"] = Result(level.value[name], unit_of_element, level.std[name])
    for k, axis in enumerate(AXES):
        value, std = float(extremes.hard_iron[k]), float(extremes.hard_iron_std[k])
        results[f"hard-iron-by-hand-{axis}"] = (
            Result(value, unit, std)
            if np.isfinite(value)
            else Missing(f"{axis} was vertical in every turn; use more mounts")
        )
    soft = extremes.soft_iron
    ratio, ratio_std = soft.least / soft.greatest, noise * hypot(1 / soft.least, 1 / soft.greatest)
    results["soft-iron-by-hand"] = Result(ratio, "", hypot(soft.ratio_std, ratio * ratio_std))
    angle_deg = (np.degrees(soft.angle_rad) + 90) % 180 - 90  # an axis has no direction
    results["soft-iron-angle-by-hand"] = Result(float(angle_deg), "deg", soft.angle_std_deg(noise))
    return results | {"left-by-hand": Result(extremes.left_per_mille, "per mille")}
