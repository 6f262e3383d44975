"""The poses that Ang's equations single out: an axis held up and held down at each inclination, the turn at 90 deg.

Poses are told by the specific force at their angles, not by the angles: alpha and -alpha, a turned mount or a sensor
face down then find their places by themselves.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrations.errors import DataError
from calibrations.table import Array, Table

DECIMALS = 1  # of an inclination in deg: the digital level's resolution
UP_AND_DOWN_DEG = ((0, 180), (90, 270))  # beta where x, y are held up and down, at alpha = 90


@dataclass(frozen=True)
class Plane:
    """One inclination: the mean output where the axis is held up, and where it is held down, V; a_z in g."""

    inclination_deg: float
    a_z: float
    up: float
    down: float

    @property
    def vertical(self) -> bool:
        """Whether the sensing plane is vertical: alpha = 90 deg."""
        return self.inclination_deg == 90

    @property
    def bias(self) -> float:
        """V. Ang (2)."""
        return (self.up + self.down) / 2

    @property
    def scale(self) -> float:
        """V/g. Ang (1), which holds at 90 deg, over sin(alpha) at any other inclination."""
        return (self.up - self.down) / (2 * float(np.sqrt(1 - self.a_z**2)))


def in_vertical_plane(a: Array) -> NDArray[np.bool_]:
    """Rows at alpha = 90 deg, of specific force `a`, shape (n, 3)."""
    return np.asarray(_inclinations(a) == 90)


def planes(table: Table, k: int, v: Array, a: Array) -> list[Plane]:
    """Every inclination where axis `k` (0 or 1) was held both up and down; outputs `v` (n,), repeats averaged.

    Raises DataError if the one at 90 deg is not among them, or fewer than three are.
    """
    found = list(_planes(k, v, a))
    up, down = UP_AND_DOWN_DEG[k]
    if not any(plane.vertical for plane in found):
        raise DataError(
            f"{table.source}: the stepwise estimate needs poses at alpha = 90, beta = {up} and {down} deg, "
            f"where {'xy'[k]} is held up and down; measure a full turn at alpha = 90"
        )
    if len(found) < 3:
        angles = " and ".join(f"{plane.inclination_deg:g}" for plane in found)
        raise DataError(
            f"{table.source}: the stepwise estimate needs three inclinations with poses at beta = {up} and {down} deg; "
            f"it has {angles} deg; measure full turns at more"
        )
    return found


def _planes(k: int, v: Array, a: Array) -> Iterator[Plane]:
    inclination = _inclinations(a)
    aligned = np.abs(a[:, 1 - k]) < np.radians(10.0**-DECIMALS)
    for angle in np.unique(inclination):
        here = aligned & (inclination == angle)
        up, down = here & (a[:, k] > 0), here & (a[:, k] < 0)
        if 0 < angle < 180 and up.any() and down.any():
            yield Plane(float(angle), float(np.mean(a[up | down, 2])), float(np.mean(v[up])), float(np.mean(v[down])))


def _inclinations(a: Array) -> Array:
    """Angle between the sensor's z axis and the vertical, deg, 0 to 180, shape (n,)."""
    angle: Array = np.degrees(np.arccos(np.clip(a[:, 2], -1.0, 1.0)))
    return np.asarray(np.round(angle, DECIMALS))
