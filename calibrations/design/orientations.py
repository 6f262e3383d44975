"""The next orientation of a sensor that a person turns: the most informative of 26, and how to turn to it.

The magnitude of what a triad measures is a sum of nine spherical harmonics over the directions (`geometry/sphere.py`):
bias, scale factors and angles are nine numbers that follow from them. An orientation has a row of their values, and
D-optimality chooses the row that adds most information to those measured. An orientation is the direction upward in
the frame of the sensor; the turn about the vertical has no effect.

Source  Atkinson, Donev and Tobias, Optimum Experimental Designs, with SAS (2007), ch. 11, sequential designs;
        IEEE Std 1293, multipoint tests.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from calibrations.design.optimal_design import DOptimal, information_gain
from calibrations.geometry.sphere import harmonics, sphere_centre, unit_vectors
from calibrations.table import AXES, Array

FIRST_SIDES = 6  # only whole sides are requested until the centre of the sphere is known, after five positions
CENTRE_POSITIONS = 5
ALIKE = 0.02  # relative difference of gains that counts as none: the nearer orientation is chosen
GOOD_SHARE = 0.5  # share of the best gain that makes any other position worth taking
CELL_DEG = 30.0  # distance from a named orientation within which it counts as covered
NEAR_DEG = 25.0  # distance within which the sensor is at the wanted orientation
LEAST_TURN = 0.3  # of the largest distance between outputs: a smaller one is the same position

CORNERS = [corner for corner in product((1, 0, -1), repeat=3) if any(corner)]
ORIENTATIONS: Array = np.array(
    [np.array(c) / np.linalg.norm(c) for c in sorted(CORNERS, key=lambda c: sum(map(abs, c)))]
)


@dataclass(frozen=True)
class NextOrientation:
    """The next orientation: `up` (3,) is the direction upward in the sensor's frame, one of ORIENTATIONS.

    `words`: the side that is upward. `turn`: how to turn the sensor from its last position; empty if that is not known.
    """

    up: Array
    words: str
    turn: str


def directions_up(outputs: Array, named_directions: Array) -> Array:
    """Directions upward of the positions with the mean `outputs` (n, 3), as unit vectors (n, 3).

    The first positions do not determine the zero of the sensor: for them these are `named_directions` (n, 3).
    """
    if len(outputs) < CENTRE_POSITIONS:
        return named_directions
    return unit_vectors(outputs - sphere_centre(outputs))


def next_orientation(measured: Array, last: Array | None = None, sides: int = FIRST_SIDES) -> NextOrientation:
    """The most informative orientation after those `measured` (n, 3). Among equals it is the nearest to `last` (3,).

    Of the first `sides` orientations each is a whole side, as long as there is one that is not taken.
    """
    free = not len(measured) or (ORIENTATIONS[:FIRST_SIDES] @ measured.T).max(axis=1).min() < 1 - 1e-6
    candidates = ORIENTATIONS[:FIRST_SIDES] if len(measured) < sides and free else ORIENTATIONS
    gains = gain(measured, candidates)
    closeness = candidates @ (candidates[0] if last is None else last)
    best = np.flatnonzero(gains >= gains.max() * (1 - ALIKE))
    up = candidates[best[np.argmax(closeness[best])]]
    return NextOrientation(up, orientation_words(up), "" if last is None else turn_words(last, up))


def gain(measured: Array, candidates: Array) -> Array:
    """Information of each orientation of `candidates` (k, 3) after those `measured` (n, 3), shape (k,)."""
    degree = 1 if len(measured) < FIRST_SIDES else 2
    rows = harmonics(candidates, degree)[:, None, :]
    return information_gain(harmonics(measured.reshape(-1, 3), degree)[:, None, :], rows, DOptimal())


def is_informative(up: Array, proposed: Array, measured: Array) -> bool:
    """Whether a rest with `up` (3,) upward is useful: it is the `proposed` one, or gives about as much information."""
    if up @ proposed >= np.cos(np.radians(NEAR_DEG)):
        return True
    gains = gain(measured, np.array([up, proposed]))
    return bool(gains[0] >= GOOD_SHARE * gains[1])


def is_other_side(mean: Array, outputs: Array, noise_std: float) -> bool:
    """Whether the mean (3,) is another position than `outputs` (n, 3), before their directions are known."""
    if not len(outputs):
        return True
    distance = np.linalg.norm(outputs[:, None] - outputs[None], axis=2).max()
    least = LEAST_TURN * distance if distance > 0 else 10 * noise_std
    return bool(np.min(np.linalg.norm(outputs - mean, axis=1)) > least)


def find_covered(measured: Array) -> Array:
    """Which of ORIENTATIONS have a position within CELL_DEG, shape (26,)."""
    if not len(measured):
        return np.zeros(len(ORIENTATIONS), dtype=bool)
    return np.asarray((ORIENTATIONS @ measured.T).max(axis=1) >= np.cos(np.radians(CELL_DEG)))


def name_orientation(words: str) -> Array | None:
    """The orientation of these `words`, (3,); None if they name none."""
    return next((up for up in ORIENTATIONS if orientation_words(up) == words), None)


def orientation_words(up: Array) -> str:
    """`+z side up`, `edge +x +z up`, `corner +x -y +z up`."""
    sides = [f"{'+' if part > 0 else '-'}{axis}" for axis, part in zip(AXES, up, strict=True) if abs(part) > 0.1]
    return f"{sides[0]} side up" if len(sides) == 1 else f"{('edge', 'corner')[len(sides) - 2]} {' '.join(sides)} up"


def turn_words(last: Array, up: Array) -> str:
    """The instruction to turn from `last` upward to `up` upward: the angle, and the sides that rise and fall most."""
    angle_deg = float(np.degrees(np.arccos(np.clip(last @ up, -1.0, 1.0))))
    if angle_deg < 5:
        return "leave it as it is"
    if angle_deg > 175:
        return "turn it upside down"
    rising = np.where(np.abs(up) > 0.1, (up - last) * np.sign(up), -np.inf)  # of the sides that shall be upward
    strongest = int(np.argmax(rising))
    return (
        f"turn it by {angle_deg:.0f} deg, so that its {'+' if up[strongest] > 0 else '-'}{AXES[strongest]} side rises"
    )
