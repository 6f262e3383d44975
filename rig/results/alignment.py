"""Results on directions: the tilt of the table (level-check), and the axes of the sensor (misalignment)."""

from __future__ import annotations

from math import hypot

import numpy as np

from calibrations.analyses.misalignment import Direction, correction_matrix, estimate_directions, non_orthogonality_deg
from procedures.level_check import reversal
from rig.record.measured import MeasuredRun
from rig.results.result import Result, evaluates

REFERENCE = "xyz"


@evaluates("level-check", of_bench=True)
def level_check(measured: MeasuredRun) -> dict[str, Result]:
    """Tilt of the table or of the base along x and y of the level, and the offset of the level, deg."""
    readings = {reading.name: reading for reading in measured.readings()}
    place = "base" if measured.run.settings.get("on") == "base" else "level"
    results = {}
    for axis in "xy":
        front, reverse = readings[f"{place}-front-{axis}"], readings[f"{place}-back-{axis}"]
        std = hypot(front.std, reverse.std) / 2 if front.std is not None and reverse.std is not None else None
        tilt_deg, offset_deg = reversal(front.value, reverse.value)
        results[f"{place}-{axis}"] = Result(tilt_deg, "deg", std)
        results[f"{place}-offset-{axis}"] = Result(offset_deg, "deg", std)
    return results


@evaluates("misalignment")
def misalignment(measured: MeasuredRun) -> dict[str, Result]:
    """theta-xx .. theta-yz, alpha-x .. beta-y in deg, and the matrix of Ang (20)-(21) that corrects accelerations.

    Raises DataError if no round of the search is complete.
    """
    directions = estimate_directions(measured.table())
    results: dict[str, Result] = {}
    for direction in directions.values():
        results |= _axis_results(direction)
    value, std = non_orthogonality_deg(directions["x"], directions["y"])
    results["non-orthogonality"] = Result(value, "deg", std)
    matrix = correction_matrix(directions["x"].theta, directions["y"].theta)
    for (row, column), factor in np.ndenumerate(matrix):
        results[f"correction-{REFERENCE[row]}{REFERENCE[column]}"] = Result(float(factor), "")
    return results | {"rounds": Result(float(directions["x"].rounds), "")}


def _axis_results(direction: Direction) -> dict[str, Result]:
    stds = np.sqrt(np.diag(direction.covariance))
    thetas = {
        f"theta-{direction.axis}{reference}": Result(float(value), "", float(std))
        for reference, value, std in zip(REFERENCE, direction.theta, stds, strict=True)
    }
    stds_deg = np.sqrt(np.diag(direction.angles_covariance_deg2))
    angles = {
        f"{name}-{direction.axis}": Result(float(value), "deg", float(std))
        for name, value, std in zip(("alpha", "beta"), direction.angles_deg, stds_deg, strict=True)
    }
    return thetas | angles
