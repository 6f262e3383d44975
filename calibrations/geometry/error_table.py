"""Errors of a rotary stage by its angle, as an autocollimator measures them, and the true angles that follow.

    true = set + error(set)      error: the angle reached less the angle set

Between points the true angle follows monotone cubics (Fritsch and Carlson): it stays between its neighbours and never
reverses. The table repeats every turn. A gap longer than LONGEST_GAP_DEG is not interpolated, as nothing was measured
there; a point's error holds within POINT_REACH_DEG of it.

Source  ISO 230-2, positional deviation: reached less target; GUM 4.3 for the standard uncertainty.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy  # scipy.interpolate loads slowly: it is imported at its first use
from numpy.typing import ArrayLike

from calibrations.criteria import LONGEST_GAP_DEG, POINT_REACH_DEG
from calibrations.errors import DataError
from calibrations.files import open_text_file
from calibrations.table import Array

COLUMN_NAMES = ("angle_deg", "error_deg", "std_deg")
TURN_DEG = 360.0
Point = tuple[float, float, float]  # angle, error, standard uncertainty of the error, deg


@dataclass(frozen=True)
class ErrorTable:
    """Points in any order; repeated angles, such as 0 and 360, get the mean of their errors.

    Raises DataError for points that no stage can have.
    """

    points: tuple[Point, ...]

    def __post_init__(self) -> None:
        values = np.array(self.points, dtype=np.float64).reshape(-1, len(COLUMN_NAMES))
        if not len(values):
            raise DataError(f"the error table is empty; give points with the columns {', '.join(COLUMN_NAMES)}")
        if not np.isfinite(values).all() or (values[:, 2] < 0).any():
            raise DataError("the error table has a value that is not finite, or a standard uncertainty below 0")
        angles, errors, _ = self._nodes
        reversals = np.flatnonzero(np.diff(angles + errors) <= 0)
        if reversals.size:
            angle_deg = angles[reversals[0]] % TURN_DEG
            raise DataError(
                f"with this error table the stage turns backwards after {angle_deg:g} deg; are its errors in deg?"
            )

    @cached_property
    def _nodes(self) -> tuple[Array, Array, Array]:
        """Angles, errors and uncertainties in order, over three turns: the middle one is from 0 to 360 deg."""
        angle, error, std = np.array(self.points, dtype=np.float64).T
        distinct, place = np.unique(np.round(angle % TURN_DEG, 9) % TURN_DEG, return_inverse=True)
        mean = np.bincount(place, error) / np.bincount(place)
        largest = np.array([std[place == k].max() for k in range(len(distinct))])
        turns = np.concatenate([distinct - TURN_DEG, distinct, distinct + TURN_DEG])
        return turns, np.tile(mean, 3), np.tile(largest, 3)

    def true_deg(self, set_deg: ArrayLike) -> tuple[Array, Array]:
        """(true angles, their standard uncertainties from the table) in deg, of angles that were set, shape (n,).

        Raises DataError for an angle at which the table has nothing.
        """
        angles_set = np.atleast_1d(np.asarray(set_deg, dtype=np.float64))
        angles, errors, stds = self._nodes
        angles_in_table = self._close_gaps(angles_set % TURN_DEG, angles_set)
        true = scipy.interpolate.PchipInterpolator(angles, angles + errors)(angles_in_table)
        return angles_set + true - angles_in_table, np.interp(angles_in_table, angles, stds)

    def _close_gaps(self, angles_in_turn: Array, stated_angles: Array) -> Array:
        """`angles_in_turn`, moved to the nearest point at the edge of a gap. Raises DataError inside a gap."""
        angles = self._nodes[0]
        k = np.searchsorted(angles, angles_in_turn, side="right") - 1
        lower, upper = angles[k], angles[k + 1]
        nearest = np.where(angles_in_turn - lower <= upper - angles_in_turn, lower, upper)
        is_covered = upper - lower <= LONGEST_GAP_DEG
        uncovered = np.flatnonzero(~is_covered & (np.abs(angles_in_turn - nearest) > POINT_REACH_DEG))
        if uncovered.size:
            first = uncovered[0]
            raise DataError(
                f"at {stated_angles[first]:g} deg the stage's error table has no point between {lower[first]:g} and "
                f"{upper[first]:g} deg; measure there, or choose angles within the table"
            )
        return np.where(is_covered, angles_in_turn, nearest)


def read_error_table(path: Path) -> tuple[Point, ...]:
    """The points in a CSV file with the columns angle_deg, error_deg, std_deg; lines with # are remarks.

    Raises DataError with file, line and column.
    """
    with open_text_file(path).lines() as lines:
        rows = csv.DictReader(_without_remarks(lines), skipinitialspace=True)
        if missing := [name for name in COLUMN_NAMES if name not in (rows.fieldnames or ())]:
            raise DataError(
                f"{path}: an error table needs the columns {', '.join(COLUMN_NAMES)}; {missing[0]} is missing"
            )
        return tuple(_point(path, number, row) for number, row in enumerate(rows, 1))


def _without_remarks(lines: Iterable[str]) -> Iterable[str]:
    return (line for line in lines if line.strip() and not line.startswith("#"))


def _point(path: Path, number: int, row: dict[str, str]) -> Point:
    try:
        angle, error, std = (float(row[name]) for name in COLUMN_NAMES)
    except (TypeError, ValueError):
        raise DataError(f"{path}: point {number} is {', '.join(map(str, row.values()))}; give three numbers") from None
    return angle, error, std
