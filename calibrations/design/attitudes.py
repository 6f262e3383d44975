"""The next attitude of a magnetometer that a person turns: the most informative of 144, by the field in the sensor.

A person cannot point a side along the field, whose direction is not known, but can lay a side or an edge upward and
point another one to the north. An attitude is these two directions in the frame of the sensor. The field in the frame
of the room (north, west, upward) follows from the positions so far, so "north" may be any fixed direction. With it each
attitude has a direction of the field in the sensor, and the information of this direction is that of
`calibrations.design.orientations`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibrations.design.orientations import ALIKE, FIRST_SIDES, ORIENTATIONS, gain, orientation_words, turn_words
from calibrations.table import Array

EDGES_UP = 18  # sides and edges can be laid upward; a corner hardly keeps its heading
PREFERRED_SHARE = 0.85  # share of the best gain that is enough for a side upward, which rests on the table
ASSUMED_DIP_DEG = 60.0  # of the field below the horizontal, until positions show it


@dataclass(frozen=True)
class Attitude:
    """The directions upward and to the north in the frame of the sensor, unit vectors (3,)."""

    up: Array
    north: Array

    @property
    def words(self) -> str:
        """`+z side up, +x side to the north`."""
        return f"{orientation_words(self.up)}, {orientation_words(self.north).removesuffix(' up')} to the north"

    @property
    def matrix(self) -> Array:
        """From the frame of the room (north, west, upward) to that of the sensor, shape (3, 3)."""
        return np.column_stack([self.north, np.cross(self.up, self.north), self.up])


ATTITUDES = tuple(
    Attitude(up, north) for up in ORIENTATIONS[:EDGES_UP] for north in ORIENTATIONS if abs(up @ north) < 1e-9
)
FIRST = Attitude(np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]))
MATRICES: Array = np.array([attitude.matrix for attitude in ATTITUDES])
LIES: Array = np.array([np.abs(attitude.up).max() > 0.99 for attitude in ATTITUDES])


@dataclass(frozen=True)
class NextAttitude:
    """The next attitude, the direction of the field in it (3,), and how to turn the sensor there."""

    attitude: Attitude
    direction: Array
    turn: str

    @property
    def words(self) -> str:
        """The attitude in words."""
        return self.attitude.words


def assumed_field() -> Array:
    """The direction of the field in the frame of the room before it is known, (3,)."""
    dip = np.radians(ASSUMED_DIP_DEG)
    return np.array([np.cos(dip), 0.0, -np.sin(dip)])


def estimate_field(directions: Array, attitudes: Sequence[Attitude]) -> Array:
    """The direction of the field in the frame of the room, (3,), from those in the sensor (n, 3).

    The median allows some positions in another attitude than the stated one.
    """
    in_room = np.array([attitude.matrix.T @ u for attitude, u in zip(attitudes, directions, strict=True)])
    middle = np.median(in_room, axis=0)
    return np.asarray(middle / max(float(np.linalg.norm(middle)), np.finfo(float).tiny))


def next_attitude(measured: Array, field: Array, last: Attitude | None) -> NextAttitude:
    """The most informative attitude after directions of the field `measured` (n, 3); `field` (3,) is in the room.

    Among equals it is the nearest to `last`. The first ones have a side upward.
    """
    candidates = MATRICES @ field
    gains = gain(measured, candidates)
    if len(measured) < FIRST_SIDES or gains[LIES].max() >= PREFERRED_SHARE * gains.max():
        gains = np.where(LIES, gains, -np.inf)
    best = np.flatnonzero(gains >= gains.max() - ALIKE * abs(gains.max()))
    reference = FIRST if last is None else last
    closeness = np.einsum("nij,ij->n", MATRICES[best], reference.matrix)
    k = int(best[np.argmax(closeness)])
    return NextAttitude(ATTITUDES[k], candidates[k], "" if last is None else _turn_words(last, ATTITUDES[k]))


def name_attitude(words: str) -> Attitude | None:
    """The attitude of these `words`; None if they name none."""
    return next((attitude for attitude in ATTITUDES if attitude.words == words), None)


def _turn_words(last: Attitude, attitude: Attitude) -> str:
    """How to turn from one attitude to another: about the vertical, or first over an edge and then to the north."""
    if last.up @ attitude.up < 1 - 1e-6:
        return turn_words(last.up, attitude.up)
    angle_deg = np.degrees(np.arctan2(np.cross(last.north, attitude.north) @ attitude.up, last.north @ attitude.north))
    side = "clockwise" if angle_deg > 0 else "anticlockwise"
    return f"turn it by {abs(angle_deg):.0f} deg {side}, seen from above" if abs(angle_deg) > 5 else "leave it as it is"
