"""misalignment: the directions of the sensing axes, their angles, and the matrix that corrects for them."""

from __future__ import annotations

import numpy as np

from calibrations.analyses.misalignment import Direction, correction_matrix, estimate_directions, non_orthogonality_deg
from rig.record.measured import Measured
from rig.results.result import Result

REFERENCE = "xyz"
NAMES = (
    *(f"theta-{axis}{reference}" for axis in "xy" for reference in REFERENCE),
    *("alpha-{axis}", "beta-{axis}", "non-orthogonality", "rounds"),
    *(f"correction-{row}{column}" for row in REFERENCE for column in REFERENCE),
)


def evaluate(measured: Measured) -> dict[str, Result]:
    """theta-xx .. theta-yz, alpha-x .. beta-y in deg, and the matrix of Ang (20)-(21) that corrects accelerations.

    Raises DataError if no round of the search is complete.
    """
    directions = estimate_directions(measured.table())
    results: dict[str, Result] = {}
    for direction in directions.values():
        results |= _of_axis(direction)
    value, std = non_orthogonality_deg(directions["x"], directions["y"])
    results["non-orthogonality"] = Result(value, "deg", std)
    matrix = correction_matrix(directions["x"].theta, directions["y"].theta)
    for (row, column), factor in np.ndenumerate(matrix):
        results[f"correction-{REFERENCE[row]}{REFERENCE[column]}"] = Result(float(factor), "")
    return results | {"rounds": Result(float(directions["x"].rounds), "")}


def _of_axis(direction: Direction) -> dict[str, Result]:
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
