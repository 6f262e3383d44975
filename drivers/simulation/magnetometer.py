"""A magnetometer: three Hall plates on one board, beside a magnet and iron that turn with them.

field of the place -> bent by iron, added to by a magnet -> part along each plate's normal -> Hall voltage -> amplifier

A Hall plate's sensitivity falls as the field bends the carriers' way (magnetoresistance), and with temperature.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from drivers.simulation.gravity import rotation
from drivers.simulation.iron import Iron, Magnet, near_iron_ut, near_magnet_ut
from drivers.simulation.kernel import Floats, kernel


@dataclass(frozen=True)
class HallPlate:
    """One plate behind its amplifier."""

    volts_per_ut: float = 0.02
    offset_v: float = 0.0  # the contacts are not quite opposite each other
    bend_per_mt2: float = 0.0  # relative loss of sensitivity by the field along the plate
    softening_ppm_per_k: float = 0.0


@dataclass(frozen=True)
class Magnetometer:
    """The plates, how the chip lies on the board, and what lies beside it, in the board's frame."""

    x: HallPlate = field(default_factory=HallPlate)
    y: HallPlate = field(default_factory=HallPlate)
    z: HallPlate = field(default_factory=HallPlate)
    turn_x_deg: float = 0.0
    turn_y_deg: float = 0.0
    turn_z_deg: float = 0.0
    y_off_square_deg: float = 0.0  # how far the y plate's normal leans toward x
    z_off_square_deg: float = 0.0  # how far the z plate's normal leans toward y
    magnet: Magnet = field(default_factory=Magnet)
    iron: Iron = field(default_factory=Iron)
    noise_v: float = 2e-3  # rms of a sample


def normals(sensor: Magnetometer) -> Floats:
    """The plates' normals in the board's frame, one a row, shape (3, 3)."""
    y, z = np.radians([sensor.y_off_square_deg, sensor.z_off_square_deg])
    plates = np.array([[1, 0, 0], [np.sin(y), np.cos(y), 0], [0, np.sin(z), np.cos(z)]])
    return np.asarray(plates @ rotation(sensor.turn_x_deg, sensor.turn_y_deg, sensor.turn_z_deg))


@kernel
def read_v(
    sensor: Magnetometer, plates: Floats, fx: float, fy: float, fz: float, warmer_k: float, volts: Floats
) -> None:
    """Fill `volts` (3,) in a field (fx, fy, fz) of the place, in the board's frame, uT."""
    bx, by, bz = near_iron_ut(sensor.iron, fx, fy, fz)
    mx, my, mz = near_magnet_ut(sensor.magnet)
    bx, by, bz = bx + mx, by + my, bz + mz
    volts[0] = hall_v(sensor.x, plates[0, 0] * bx + plates[0, 1] * by + plates[0, 2] * bz, warmer_k)
    volts[1] = hall_v(sensor.y, plates[1, 0] * bx + plates[1, 1] * by + plates[1, 2] * bz, warmer_k)
    volts[2] = hall_v(sensor.z, plates[2, 0] * bx + plates[2, 1] * by + plates[2, 2] * bz, warmer_k)


@kernel
def hall_v(plate: HallPlate, b_ut: float, warmer_k: float) -> float:
    """Output of one plate in a field along its normal."""
    lost = plate.bend_per_mt2 * (1e-3 * b_ut) ** 2 - 1e-6 * plate.softening_ppm_per_k * warmer_k
    return plate.offset_v + plate.volts_per_ut * b_ut / (1 + lost)
