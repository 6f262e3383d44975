"""Progress of a calibration of a gyroscope by hand: the rests so far, and whether the turns between them are enough.

The orientations are those of an accelerometer (`calibrations.analyses.hand_positions`): turns between sides, edges and
corners have axes in all directions. The turns suffice when the standard uncertainty of every scale factor, as a share
of it, and of every angle, in rad, is at most the wanted one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calibrations.analyses.hand_positions import FEWEST, HandCourse, largest_error
from calibrations.criteria import SMALLEST_TURN_DEG
from calibrations.design.orientations import CENTRE_POSITIONS, LEAST_TURN, directions_up
from calibrations.effects.catalogue import catalogue
from calibrations.errors import CalibrationError
from calibrations.fitting.fit import Fit, fit
from calibrations.model import Estimate
from calibrations.model.file import read_model
from calibrations.table import Array, Table

MOST_NOISE = 10.0  # times the noise of a sample: the means of two rests in one orientation differ by less
MODEL, BIAS, ANGLES = "gyroscope", "gyro-bias", "gyro-misalignment"


@dataclass(frozen=True)
class TurnCourse(HandCourse):
    """The rests so far, and the `table` of the turns between them; None before the first."""

    table: Table | None = None

    def is_new(self, mean: Array) -> bool:
        """Whether a rest with this mean (3,) ends a turn: the sensor does not lie as before."""
        if not self.positions:
            return True
        if len(self.positions) < CENTRE_POSITIONS - 1:
            points = np.vstack([self.outputs, mean])
            size = float(np.linalg.norm(points[:, None] - points[None], axis=2).max())
            least = max(LEAST_TURN * size, MOST_NOISE * float(self.noise.std.max()))
            return bool(np.linalg.norm(mean - self.outputs[-1]) > least)
        up = directions_up(np.vstack([self.outputs, mean]), np.vstack([self.directions, self.next.up]))[-1]
        return bool(up @ self.directions[-1] < np.cos(np.radians(SMALLEST_TURN_DEG)))

    @cached_property
    def uncertainty(self) -> tuple[float, str]:
        """The largest standard uncertainty, and the parameter's words. Infinite with fewer than FEWEST rests."""
        if len(self.positions) < FEWEST or self.table is None:
            return np.inf, ""
        try:
            return largest_uncertainty(fit_turns(self.table))
        except CalibrationError:  # turns that cannot be used may leave too few
            return np.inf, ""


def fit_turns(table: Table) -> Fit:
    """Bias, scale factor and misalignment of a gyroscope from a table of turns. Raises as `fit`."""
    return fit(read_model(MODEL).with_effect(catalogue()[ANGLES]), table)


def largest_uncertainty(fitted: Fit) -> tuple[float, str]:
    """The largest relative standard uncertainty of a scale factor, or of an angle in rad, and its words."""

    def error(key: str, estimate: Estimate, std: float) -> float:
        if key.startswith(BIAS):
            return 0.0  # the rests show it better than the turns show the others
        return float(np.radians(std)) if key.startswith(ANGLES) else std / abs(estimate.value)

    return largest_error(fitted, error)
