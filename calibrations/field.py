"""The elements of the earth's magnetic field: X north, Y east, Z down; F total, H horizontal, D declination, I dip.

Source  Book (17.6)-(17.10), with atan2 in place of the arc tangent, which does not know the quadrant.
"""

from __future__ import annotations

import numpy as np

from calibrations.table import Array


def horizontal(x: Array, y: Array) -> Array:
    """H, in the unit of the components."""
    return np.hypot(x, y)


def total(x: Array, y: Array, z: Array) -> Array:
    """F, in the unit of the components. (17.6)"""
    return np.hypot(horizontal(x, y), z)


def declination_deg(x: Array, y: Array) -> Array:
    """D, deg from north, positive to the east. (17.9)"""
    return np.degrees(np.arctan2(y, x))


def inclination_deg(x: Array, y: Array, z: Array) -> Array:
    """I, deg from the horizontal, positive downward. (17.10)"""
    return np.degrees(np.arctan2(z, horizontal(x, y)))


def components(f: Array, d_deg: Array, i_deg: Array) -> tuple[Array, Array, Array]:
    """X, Y, Z of a field of strength F, declination D and inclination I. (17.7), (17.8)"""
    d, i = np.radians(d_deg), np.radians(i_deg)
    h = f * np.cos(i)
    return h * np.cos(d), h * np.sin(d), f * np.sin(i)
