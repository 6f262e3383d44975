"""Where the rig stands on the earth: its rotation, its magnetic field, and what iron and magnets of the rig make of it.

The frame is the rig's: x along its base, at `heading_deg` from true north, y to the left of it, z upward. A turn
of the base about its tilts is that of `gravity.vertical`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from drivers.simulation.gravity import Base, rotation
from drivers.simulation.iron import Iron, Magnet, near_iron_ut, near_magnet_ut
from drivers.simulation.kernel import Floats, record

SIDEREAL_DAY_S = 86164.0905


@dataclass(frozen=True)
class Laboratory:
    """Pittsburgh, as far as nothing else is said. Magnet and iron stand with the rig, at (x, y, z) from the sensor."""

    latitude_deg: float = 40.443
    heading_deg: float = 25.0  # of the base's x axis, clockwise from true north
    field_ut: float = 52.4
    dip_deg: float = 66.8  # of the field below the horizontal
    declination_deg: float = -9.3  # of the field's horizontal part, clockwise from true north
    magnet: Magnet = field(default_factory=Magnet)
    iron: Iron = field(default_factory=Iron)


def rotation_deg_s(place: Laboratory, base: Base) -> Floats:
    """Angular rate of the earth in the frame of the base, deg/s, shape (3,)."""
    latitude = np.radians(place.latitude_deg)
    return _in_base(base, 360 / SIDEREAL_DAY_S, np.cos(latitude), -place.heading_deg, np.sin(latitude))


def field_ut(place: Laboratory, base: Base) -> Floats:
    """The magnetic field where the sensor is, in the frame of the base, shape (3,): the earth's and what bends it."""
    dip = np.radians(place.dip_deg)
    azimuth_deg = place.declination_deg - place.heading_deg
    earth = _in_base(base, place.field_ut, np.cos(dip), azimuth_deg, -np.sin(dip))
    bent = np.array(near_iron_ut(record(place.iron), *earth))
    return np.asarray(bent + np.array(near_magnet_ut(record(place.magnet))))


def _in_base(base: Base, size: float, level: float, azimuth_deg: float, upward: float) -> Floats:
    """A vector with a horizontal part at an azimuth from the base's x axis (clockwise) and a part upward."""
    azimuth = np.radians(azimuth_deg)
    tilted = rotation(base.tilt_x_deg, base.tilt_y_deg, 0.0)
    return np.asarray(size * tilted @ np.array([level * np.cos(azimuth), -level * np.sin(azimuth), upward]))
