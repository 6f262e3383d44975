"""Hard and soft iron by hand, as the Book does it: from the extremes of a full turn, beside the fit of an ellipsoid.

    h = (max + min) / 2                                    of each axis: hard iron
    r = sqrt(x1^2 + y1^2), theta = atan2(y1, x1)           (17.11), (17.12): the point farthest from the middle
    v^ = R v, R = [[c, s], [-s, c]]                        (17.13), (17.14): the ellipse along its axes
    S = q / r, along the major axis                        (17.15): q the least radius; then back by the transpose of R

Source  Book 17.5; Konvalin, Compensating for tilt, hard-iron and soft-iron effects (2009).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.table import Array


@dataclass(frozen=True)
class Ellipse:
    """The ellipse that iron makes of a horizontal turn: greatest and least radius, and the major axis's angle."""

    greatest: float
    least: float
    angle_rad: float

    @property
    def rotation(self) -> Array:
        """R, which turns the major axis to x, shape (2, 2)."""
        c, s = np.cos(self.angle_rad), np.sin(self.angle_rad)
        return np.array([[c, s], [-s, c]])

    @property
    def correction(self) -> Array:
        """The matrix (2, 2) that makes the ellipse a circle of the least radius: rotate, scale, rotate back."""
        R = self.rotation
        return np.asarray(R.T @ np.diag([self.least / self.greatest, 1.0]) @ R)


def hard_iron(outputs: Array) -> Array:
    """Half the sum of maximum and minimum of each axis, (n, axes) -> (axes,)."""
    return np.asarray((outputs.max(axis=0) + outputs.min(axis=0)) / 2)


def ellipse(xy: Array) -> Ellipse:
    """The ellipse of the points `xy` (n, 2) about 0, hard iron taken off."""
    radius = np.linalg.norm(xy, axis=1)
    x, y = xy[np.argmax(radius)]
    return Ellipse(float(radius.max()), float(radius.min()), float(np.arctan2(y, x)))


def by_hand(outputs: Array) -> Array:
    """Outputs (n, axes) with hard iron taken off each axis, and soft iron off the first two."""
    centred = outputs - hard_iron(outputs)
    found = ellipse(centred[:, :2])
    return np.column_stack([centred[:, :2] @ found.correction, centred[:, 2:]])
