"""magnetometer-turn: hard and soft iron, by the ellipsoid and by hand; the elements of the field."""

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
from procedures.session import Pose
from rig.record.measured import Measured, sensor_from_base
from rig.results.result import Missing, Result, fitted, result

AXES = "xyz"
SOFT = ("xx", "yy", "xy", "xz", "yz")
ELEMENTS = {"F": "field-total", "H": "field-horizontal", "D": "field-azimuth", "I": "field-inclination"}
HEADING = "heading_deg"
DECLINATION = "field-declination"
NAMES = (
    *("hard-iron-{axis}", "hard-iron-by-hand-{axis}", "soft-iron-by-hand", "soft-iron-angle-by-hand"),
    *(f"soft-iron-{pair}" for pair in SOFT),
    *(*ELEMENTS.values(), DECLINATION),
    *(f"{ELEMENTS[name]}-by-hand" for name in "HD"),
    *("left-by-ellipsoid", "left-by-hand"),
)


def evaluate(measured: Measured) -> dict[str, Result | Missing]:
    """By the ellipsoid of all directions:

    hard-iron                V, of each axis
    soft-iron                relative, as in the effect soft-iron
    left-by-ellipsoid        rms of what is left of the magnitude, per mille of the field
    field-total, -horizontal F and H, V                 (17.6)
    field-azimuth            deg from the base's x axis, clockwise seen from above
    field-declination        D, deg from true north, where the bench knows the base's `heading_deg`    (17.9)
    field-inclination        I, deg below the horizontal    (17.10)

    and by hand, from the extremes of each turn, (17.11)-(17.15):

    hard-iron-by-hand        V
    soft-iron-by-hand        least over greatest radius of the turn about z
    soft-iron-angle-by-hand  deg from x to its major axis, from -90 to 90
    left-by-hand             what the magnitude then varies by, per mille
    field-horizontal-by-hand, field-azimuth-by-hand    of the turn about z alone

    In the uncertainties by hand stands what the extremes cannot see (`horizontal_turn.py`): what iron lets of the
    upright field into the level axes, unless the sensor was turned over; what it makes of H; the steps.
    How the sensor sits in its mount shows in several turns: of one, the azimuth has no uncertainty.

    Where the directions cover too little of the sphere, what the ellipsoid gives is missing and says so. Raises
    DataError where the turn about z was left out.
    """
    table, poses = measured.table(), [kept.pose for kept in measured.kept()]
    if poses[0].up != "z":
        raise DataError(
            f"run {measured.name} has no pose of the turn about z: all are excluded; take them in again with rig "
            "exclude --include"
        )
    names, std_v = [p.path for p in poses], _std_v(table)
    extremes = iron_by_extremes(table.outputs, [p.up for p in poses], names, std_v)
    why = magnetometer_coverage_warning(table)
    ellipsoid = _all_missing(why) if why else _by_ellipsoid(table, poses)
    level = [k for k, pose in enumerate(poses) if pose.path == poses[0].path]  # the turn about z, upward, is first
    attitudes = np.array([sensor_from_base(poses[k]) for k in level])
    azimuth = ellipsoid[ELEMENTS["D"]]
    std_deg = azimuth.std if isinstance(azimuth, Result) else None
    turn_std_deg = None if std_deg is None else std_deg * len(set(names)) ** 0.5
    return ellipsoid | _by_extremes(
        extremes, level_elements_by_extremes(table.outputs[level], attitudes, turn_std_deg), std_v
    )


def _std_v(table: Table) -> float:
    """Of one position's mean, V; 0 where a single sample was all of it."""
    white = white_std(table)
    return 0.0 if white is None else float(np.sqrt(np.mean(white**2)))


def _all_missing(why: str) -> dict[str, Result | Missing]:
    names = (*(f"hard-iron-{axis}" for axis in AXES), *(f"soft-iron-{pair}" for pair in SOFT), *ELEMENTS.values())
    names = (*names, "left-by-ellipsoid")
    return {name: Missing(why) for name in names}


def _by_ellipsoid(table: Table, poses: list[Pose]) -> dict[str, Result | Missing]:
    found = fitted(table, "magnetometer")
    results = {f"hard-iron-{e.axis}": result(e) for e in found.model.estimates("hard-iron")}
    results |= {f"soft-iron-{e.name}": result(e) for e in found.model.estimates("soft-iron")}
    results["left-by-ellipsoid"] = Result(float(1e3 * rms(found.residual)[0]), "per mille")
    return results | _elements(found, table, poses)


def _elements(found: Fit, table: Table, poses: list[Pose]) -> dict[str, Result | Missing]:
    made = calibration_matrices(found)
    if made is None:
        return {name: Missing("the ellipsoid gives no calibration") for name in ELEMENTS.values()}
    (strength,) = found.model.estimates("field-strength")
    attitudes: Array = np.array([sensor_from_base(pose) for pose in poses])
    turned = field_elements(strength.value * made(table.outputs), attitudes, [p.path for p in poses])
    units = {"F": "V", "H": "V", "D": "deg", "I": "deg"}
    results: dict[str, Result | Missing] = {}
    for name, value in turned.value.items():
        std, of_strength = (
            turned.std[name],
            (strength.std or 0.0) * value / strength.value if units[name] == "V" else 0.0,
        )
        results[ELEMENTS[name]] = Result(value, units[name], None if std is None else hypot(std, of_strength))
        if name == "D" and HEADING in table.constants:
            from_north = (value + table.number(HEADING, 0.0) + 180) % 360 - 180
            results[DECLINATION] = Result(from_north, "deg", std)
    return results


def _by_extremes(found: ExtremesEstimate, level: Elements, noise_v: float) -> dict[str, Result | Missing]:
    results: dict[str, Result | Missing] = {}
    for name, unit in (("H", "V"), ("D", "deg")):
        results[f"{ELEMENTS[name]}-by-hand"] = Result(level.value[name], unit, level.std[name])
    for k, axis in enumerate(AXES):
        value, std = float(found.hard_iron[k]), float(found.hard_iron_std[k])
        results[f"hard-iron-by-hand-{axis}"] = (
            Result(value, "V", std)
            if np.isfinite(value)
            else Missing(f"{axis} was vertical in every turn; use more mounts")
        )
    soft = found.soft_iron
    ratio, noise = soft.least / soft.greatest, noise_v * hypot(1 / soft.least, 1 / soft.greatest)
    results["soft-iron-by-hand"] = Result(ratio, "", hypot(soft.ratio_std, ratio * noise))
    angle_deg = (np.degrees(soft.angle_rad) + 90) % 180 - 90  # an axis has no direction
    results["soft-iron-angle-by-hand"] = Result(float(angle_deg), "deg", soft.angle_std_deg(noise_v))
    return results | {"left-by-hand": Result(found.left_per_mille, "per mille")}
