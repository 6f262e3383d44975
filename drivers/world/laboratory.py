"""The place of the rig on the earth: rotation and magnetic field, with iron and magnets near the sensor as dipoles.

The moment of a magnet is constant. The moment of a ball of iron comes from the field around it,
m = 4 pi a^3 / mu_0 (mu - 1) / (mu + 2) B; it adds the field of a dipole. Source: Jackson, Classical Electrodynamics,
5.6 and 5.11.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from drivers.world.gravity import Base, rotation
from drivers.world.kernel import Floats, kernel, record

UT_PER_MOMENT = 1e5  # mu_0 / 4 pi, for a moment in mA m^2 at a distance in mm


@dataclass(frozen=True)
class Magnet:
    """A small permanent magnet: its position relative to the sensor, and its moment."""

    x_mm: float = 30.0
    y_mm: float = 0.0
    z_mm: float = 0.0
    moment_x_ma_m2: float = 0.0
    moment_y_ma_m2: float = 0.0
    moment_z_ma_m2: float = 0.0


@dataclass(frozen=True)
class Iron:
    """A ball of soft iron and its position relative to the sensor."""

    x_mm: float = 0.0
    y_mm: float = 20.0
    z_mm: float = 0.0
    radius_mm: float = 0.0
    permeability_ratio: float = 1000.0


@kernel
def dipole_ut(x_mm: float, y_mm: float, z_mm: float, mx: float, my: float, mz: float) -> tuple[float, float, float]:
    """Field at the sensor of a moment (mA m^2) that lies at (x, y, z) from it."""
    r = math.sqrt(x_mm * x_mm + y_mm * y_mm + z_mm * z_mm)
    ux, uy, uz = x_mm / r, y_mm / r, z_mm / r
    radial = 3 * (mx * ux + my * uy + mz * uz)
    size = UT_PER_MOMENT / (r * r * r)
    return size * (radial * ux - mx), size * (radial * uy - my), size * (radial * uz - mz)


@kernel
def near_magnet_ut(magnet: Magnet) -> tuple[float, float, float]:
    """The field of a magnet."""
    moment = magnet.moment_x_ma_m2, magnet.moment_y_ma_m2, magnet.moment_z_ma_m2
    return dipole_ut(magnet.x_mm, magnet.y_mm, magnet.z_mm, moment[0], moment[1], moment[2])


@kernel
def near_iron_ut(iron: Iron, bx: float, by: float, bz: float) -> tuple[float, float, float]:
    """The field (bx, by, bz) near the iron."""
    share = iron.radius_mm**3 * (iron.permeability_ratio - 1) / (iron.permeability_ratio + 2) / UT_PER_MOMENT
    dx, dy, dz = dipole_ut(iron.x_mm, iron.y_mm, iron.z_mm, share * bx, share * by, share * bz)
    return bx + dx, by + dy, bz + dz


# Rotation of the earth and its magnetic field, in the frame of the rig: x along its base, at `heading_deg` from true
# north, y to the left, z upward. The tilt of the base is that of `gravity.vertical`.

SIDEREAL_DAY_S = 86164.0905


@dataclass(frozen=True)
class Laboratory:
    """Pittsburgh by default. Magnet and iron are fixed to the rig, at (x, y, z) from the sensor."""

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
    return _base_vector(base, 360 / SIDEREAL_DAY_S, np.cos(latitude), -place.heading_deg, np.sin(latitude))


def field_ut(place: Laboratory, base: Base) -> Floats:
    """The magnetic field at the sensor with iron and magnets, in the frame of the base, uT, shape (3,)."""
    dip = np.radians(place.dip_deg)
    azimuth_deg = place.declination_deg - place.heading_deg
    earth = _base_vector(base, place.field_ut, np.cos(dip), azimuth_deg, -np.sin(dip))
    bent = np.array(near_iron_ut(record(place.iron), *earth))
    return np.asarray(bent + np.array(near_magnet_ut(record(place.magnet))))


def _base_vector(base: Base, size: float, level: float, azimuth_deg: float, upward: float) -> Floats:
    """A vector with a horizontal part at an azimuth from the base's x axis (clockwise) and a part upward."""
    azimuth = np.radians(azimuth_deg)
    tilted = rotation(base.tilt_x_deg, base.tilt_y_deg, 0.0)
    return np.asarray(size * tilted @ np.array([level * np.cos(azimuth), -level * np.sin(azimuth), upward]))
