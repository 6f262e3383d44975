"""Hard and soft iron by hand, as the Book does it: from the extremes of a full turn, beside the fit of an ellipsoid.

    h = (max + min) / 2                                    of each axis: hard iron
    r = sqrt(x1^2 + y1^2), theta = atan2(y1, x1)           (17.11), (17.12): the point farthest from the middle
    v^ = R v, R = [[c, s], [-s, c]]                        (17.13), (17.14): the ellipse along its axes
    S = q / r, along the major axis                        (17.15): q the least radius; then back by the transpose of R

What it cannot see: iron also turns the field that stands upright, Z, into the level axes, by a constant that looks
like hard iron; and how much it makes of a level field on average. Neither shows in the plane. Iron of no preferred
direction has five components of one size, of which the plane shows two, as e = (r - q) / (r + q): another one is
e / sqrt(2) times a t of two degrees of freedom. Uncertainties are half of its 95 % interval, `UNSEEN` e, of Z and of
the level field. The former is gone in the mean of a turn and one turned over.

Source  Book 17.5; JCGM 100, 4.3.7 (rectangular), G.3 (t); Konvalin, Compensating for tilt, hard-iron and soft-iron
        effects (2009).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.table import Array

UNSEEN = 4.302653 / 2 / np.sqrt(2)  # t of two degrees of freedom, 97.5 %


@dataclass(frozen=True)
class Ellipse:
    """The ellipse that iron makes of a horizontal turn: greatest and least radius, and the major axis's angle; of how
    many points."""

    greatest: float
    least: float
    angle_rad: float
    n: int

    @property
    def flattening(self) -> float:
        """Half the difference of the radii over their mean."""
        return (self.greatest - self.least) / (self.greatest + self.least)

    @property
    def ratio_std(self) -> float:
        """Standard uncertainty of least over greatest radius, from the steps between points."""
        missed = self.flattening * (1 - np.cos(2 * np.pi / self.n))  # at most, of either radius
        return float(self.least / self.greatest * missed / np.sqrt(6))

    def angle_std_deg(self, noise: float) -> float:
        """That of the major axis's angle, from the steps, and from the `noise` of one radius; 52: any angle."""
        apart = max(self.greatest - self.least, 1e-12 * self.greatest)
        return float(min(np.hypot(360 / self.n / np.sqrt(12), np.degrees(noise / (2 * apart))), 180 / np.sqrt(12)))

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
    return Ellipse(float(radius.max()), float(radius.min()), float(np.arctan2(y, x)), len(xy))


def by_hand(outputs: Array) -> Array:
    """Outputs (n, axes) with hard iron taken off each axis, and soft iron off the first two."""
    centred = outputs - hard_iron(outputs)
    found = ellipse(centred[:, :2])
    return np.column_stack([centred[:, :2] @ found.correction, centred[:, 2:]])
