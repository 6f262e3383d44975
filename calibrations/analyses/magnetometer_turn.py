"""Full turns of a magnetometer, each with one axis vertical: hard and soft iron, and the elements of the earth's field.

Hard and soft iron follow from the extremes of the turns (the Book). They are compared with those of an ellipsoid fit.

    h = (max + min) / 2                                    of each axis: hard iron
    r = sqrt(x1^2 + y1^2), theta = atan2(y1, x1)           (17.11), (17.12): the point farthest from the middle
    v^ = R v, R = [[c, s], [-s, c]]                        (17.13), (17.14): the ellipse along its axes
    S = q / r, along the major axis                        (17.15): q the least radius; then back by the transpose of R

A turn in the horizontal plane does not show two effects of soft iron: a part of the vertical field Z in the horizontal
axes, which is constant and so looks like hard iron, and the mean gain of the horizontal field. Soft iron without a
preferred direction has five components of equal size. The plane shows two of them, as e = (r - q) / (r + q); each other
is e / sqrt(2) times a t of two degrees of freedom. The standard uncertainties are half of the half-width of its 95 %
interval, `HIDDEN_IRON` e, of Z and of the horizontal field. The first effect cancels in the mean of a turn and a turn
with the sensor turned over.

The calibrated outputs, turned back by the angles of the stages and the mount, are the field in the frame of the rig:
x along its base, z upward. Its elements have north = x, east = -y and down = -z. So D is not the declination, but the
azimuth from the x axis of the base, clockwise from above; the bench file has the heading of that axis.

The outputs of one turn have a common error, from the seat of the sensor in its mount. The uncertainties are therefore
from the scatter between turns.

Source  Book 17.4-17.5, (17.6)-(17.15); JCGM 100, 4.3.7 (rectangular), G.3 (t); Konvalin, Compensating for tilt,
        hard-iron and soft-iron effects (2009).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calibrations.criteria import FEWEST_TURNS
from calibrations.table import Array

HIDDEN_IRON = 4.302653 / 2 / np.sqrt(2)  # 4.30: quantile 97.5 % of t with two degrees of freedom; 2: coverage factor


@dataclass(frozen=True)
class Ellipse:
    """The ellipse that iron makes of a horizontal turn: its radii, the angle of its major axis, and its points.

    `greatest` and `least` are radii in the unit of the outputs; `angle_rad` is from x to the major axis; `n` is the
    number of points.
    """

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
        """Standard uncertainty of the major axis's angle, deg, from the steps between points and from noise.

        `noise`: standard deviation of one radius. At most 180 / sqrt(12), where the angle is unknown.
        """
        difference = max(self.greatest - self.least, 1e-12 * self.greatest)
        return float(min(np.hypot(360 / self.n / np.sqrt(12), np.degrees(noise / (2 * difference))), 180 / np.sqrt(12)))

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


def estimate_hard_iron(outputs: Array) -> Array:
    """Half the sum of maximum and minimum of each axis, (n, axes) -> (axes,)."""
    return np.asarray((outputs.max(axis=0) + outputs.min(axis=0)) / 2)


def fit_ellipse(xy: Array) -> Ellipse:
    """The ellipse of the points `xy` (n, 2) about 0, without hard iron."""
    radius = np.linalg.norm(xy, axis=1)
    x, y = xy[np.argmax(radius)]
    return Ellipse(float(radius.max()), float(radius.min()), float(np.arctan2(y, x)), len(xy))


def correct_by_extremes(outputs: Array) -> Array:
    """Outputs (n, axes) without the hard iron of each axis, and without the soft iron of the first two."""
    centred = outputs - estimate_hard_iron(outputs)
    ellipse = fit_ellipse(centred[:, :2])
    return np.column_stack([centred[:, :2] @ ellipse.correction, centred[:, 2:]])


@dataclass(frozen=True)
class Elements:
    """F and H in the unit of the field, D and I in deg; standard uncertainties, None for one turn."""

    value: Mapping[str, float]
    std: Mapping[str, float | None]


@dataclass(frozen=True)
class ExtremesEstimate:
    """Hard iron of each axis that was turned in the plane, NaN of the others, (3,); soft iron of the turn about z."""

    hard_iron: Array
    hard_iron_std: Array
    soft_iron: Ellipse
    left_per_mille: float  # variation of the magnitude after the correction


def field_elements(sensed: Array, sensor_from_base: Array, turns: Sequence[str]) -> Elements:
    """Elements of a calibrated field (n, 3) at known attitudes (n, 3, 3); `turns` names the turn of each row."""
    in_base = np.einsum("nij,ni->nj", sensor_from_base, sensed)
    names = np.array(turns)
    means = np.array([in_base[names == turn].mean(axis=0) for turn in dict.fromkeys(turns)])
    value = _elements(means.mean(axis=0))
    if len(means) < FEWEST_TURNS:
        return Elements(value, dict.fromkeys(value))
    covariance = np.cov(means.T) / len(means)
    step = 1e-4 * value["F"]
    stds = {}
    for name in value:
        forward, backward = (
            np.array([_elements(means.mean(axis=0) + side * step * e)[name] for e in np.eye(3)]) for side in (1, -1)
        )
        slope = (forward - backward) / (2 * step)
        stds[name] = float(np.sqrt(slope @ covariance @ slope))
    return Elements(value, stds)


def level_elements_by_extremes(outputs: Array, sensor_from_base: Array, turn_std_deg: float | None) -> Elements:
    """H and D of a horizontal turn alone, (n, 3) at known attitudes (n, 3, 3), corrected by its own extremes.

    H is of the size that the least radius has (17.15), and uncertain by what iron makes of a field that the plane does
    not show. How the sensor sits in its mount is in D and does not show in one turn: `turn_std_deg`, from turn to turn,
    where several were made.
    """
    level = outputs[:, :2] - estimate_hard_iron(outputs[:, :2])
    round_z = fit_ellipse(level)
    level = np.column_stack([level @ round_z.correction, np.zeros(len(level))])
    in_base = np.einsum("nij,ni->nj", sensor_from_base, level)
    elements = _elements(in_base.mean(axis=0))
    azimuths = np.radians([elements["D"], elements["D"] + 90])
    std = [float((in_base[:, :2] @ [np.cos(a), -np.sin(a)]).std(ddof=1) / np.sqrt(len(level))) for a in azimuths]
    h_std = float(np.hypot(std[0], HIDDEN_IRON * round_z.flattening * elements["H"]))
    d_std = None if turn_std_deg is None else float(np.hypot(np.degrees(std[1] / elements["H"]), turn_std_deg))
    return Elements({k: elements[k] for k in "HD"}, {"H": h_std, "D": d_std})


def iron_by_extremes(outputs: Array, edges: Sequence[str], turns: Sequence[str], std: float) -> ExtremesEstimate:
    """Estimate the iron from extreme outputs (n, 3) of turns about each row's edge, z first; `std` is that of one.

    Two turns about an edge are one and one turned over.
    """
    edge, turn = np.array(edges), np.array(turns)
    about_z = outputs[turn == turn[np.argmax(edge == "z")]][:, :2]
    round_z = fit_ellipse(about_z - estimate_hard_iron(about_z))
    names = list(dict.fromkeys(turns))
    middles, unseen = np.full((2, len(names), 3), np.nan)
    for k, name in enumerate(names):
        rows, own_edge = turn == name, edge[turn == name][0]
        level = [axis for axis, letter in enumerate("xyz") if letter != own_edge]
        middles[k, level] = estimate_hard_iron(outputs[rows][:, level])
        unseen[k, level] = (
            0.0
            if len(set(turn[edge == own_edge])) > 1
            else _hidden_iron_std(outputs[rows], "xyz".index(own_edge), round_z)
        )
    count = np.sum(np.isfinite(middles), axis=0)
    measured, least = count > 0, np.maximum(count, 1)
    middle = np.where(measured, np.nansum(middles, axis=0) / least, np.nan)
    by_noise, by_iron = std / np.sqrt(2 * least), np.sqrt(np.nansum(unseen**2, axis=0)) / least  # half of a sum of two
    middle_std = np.where(measured, np.hypot(by_noise, by_iron), np.nan)
    return ExtremesEstimate(middle, middle_std, round_z, _remaining_per_mille(outputs, middle, round_z, about_z))


def _hidden_iron_std(outputs: Array, upright: int, round_z: Ellipse) -> float:
    """Standard uncertainty by the vertical field that soft iron brings into the level axes of a turn, (n, 3)."""
    return float(HIDDEN_IRON * round_z.flattening * abs(outputs[:, upright].mean()))


def magnitude_per_mille(field: Array) -> float:
    """The variation of the magnitude of a field (n, components), per mille."""
    size = np.linalg.norm(field, axis=1)
    return float(1e3 * size.std() / size.mean())


def _remaining_per_mille(outputs: Array, middle: Array, round_z: Ellipse, about_z: Array) -> float:
    """Remaining variation, per mille: of the whole sphere if all hard iron is known, otherwise of the turn about z."""
    if not np.isfinite(middle).all():
        return magnitude_per_mille((about_z - estimate_hard_iron(about_z)) @ round_z.correction)
    centred = outputs - middle
    return magnitude_per_mille(np.column_stack([centred[:, :2] @ round_z.correction, centred[:, 2:]]))


def _elements(base: Array) -> dict[str, float]:
    """The elements of a field (3,) in the frame of the rig: F total, H horizontal, D declination and I dip in deg.

    Book (17.6)-(17.10), with atan2 in place of the arc tangent, which does not know the quadrant.
    """
    north, east, down = base[0], -base[1], -base[2]
    horizontal = np.hypot(north, east)
    return {
        "F": float(np.hypot(horizontal, down)),
        "H": float(horizontal),
        "D": float(np.degrees(np.arctan2(east, north))),
        "I": float(np.degrees(np.arctan2(down, horizontal))),
    }
