"""Iron and magnets near a magnetometer, as dipoles where the field of one point is asked for.

A magnet has its moment whatever the field is. A ball of iron gets its moment from the field that it lies in,
m = 4 pi a^3 / mu_0 (mu - 1) / (mu + 2) B, and adds a dipole's field to it. Source: Jackson, Classical Electrodynamics,
5.6 and 5.11.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.simulation.kernel import kernel

UT_PER_MOMENT = 1e5  # mu_0 / 4 pi, for a moment in mA m^2 at a distance in mm


@dataclass(frozen=True)
class Magnet:
    """A small permanent magnet: where it is, seen from the sensor, and its moment."""

    x_mm: float = 30.0
    y_mm: float = 0.0
    z_mm: float = 0.0
    moment_x_ma_m2: float = 0.0
    moment_y_ma_m2: float = 0.0
    moment_z_ma_m2: float = 0.0


@dataclass(frozen=True)
class Iron:
    """A ball of soft iron: where it is, seen from the sensor."""

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
    along = 3 * (mx * ux + my * uy + mz * uz)
    size = UT_PER_MOMENT / (r * r * r)
    return size * (along * ux - mx), size * (along * uy - my), size * (along * uz - mz)


@kernel
def near_magnet_ut(magnet: Magnet) -> tuple[float, float, float]:
    """What a magnet adds to the field."""
    moment = magnet.moment_x_ma_m2, magnet.moment_y_ma_m2, magnet.moment_z_ma_m2
    return dipole_ut(magnet.x_mm, magnet.y_mm, magnet.z_mm, moment[0], moment[1], moment[2])


@kernel
def near_iron_ut(iron: Iron, bx: float, by: float, bz: float) -> tuple[float, float, float]:
    """The field (bx, by, bz) as it is beside the iron."""
    share = iron.radius_mm**3 * (iron.permeability_ratio - 1) / (iron.permeability_ratio + 2) / UT_PER_MOMENT
    dx, dy, dz = dipole_ut(iron.x_mm, iron.y_mm, iron.z_mm, share * bx, share * by, share * bz)
    return bx + dx, by + dy, bz + dz
