"""The sensors of rotation and field on the board: a gyroscope and a magnetometer.

A gyroscope has for each axis two proof masses that oscillate in opposite directions at the resonance of the drive. A
rate about the input axis deflects them to opposite sides at the same frequency by Coriolis forces, near the resonance
of the sense mode. Springs that are not perpendicular deflect them too (quadrature), a quarter of a period later; an
imperfect demodulator passes a part of it. A load along the sense direction displaces both masses equally, but for their
unbalance, and a displacement of a mass changes the angle between its springs.

Source  Acar and Shkel, MEMS Vibratory Gyroscopes (2009), chapters 3 and 4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from drivers.world.accelerometer import STANDARD_GRAVITY_M_S2
from drivers.world.gravity import across, rotation
from drivers.world.kernel import Floats, kernel
from drivers.world.laboratory import Iron, Magnet, near_iron_ut, near_magnet_ut

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Tines:
    """The pair of masses of one axis, its drive, its pick-up and its demodulator."""

    drive_um: float = 6.0  # amplitude
    drive_ppm_per_k: float = 0.0  # how the amplitude's control drifts
    drive_hz: float = 15e3
    split_hz: float = 300.0  # of the sense resonance above the drive's
    off_square_ppm: float = 0.0  # stiffness that couples drive to sense, over the sense mode's own
    off_square_per_nm: float = 0.0  # its growth by a displacement of the mass, ppm
    unbalance_fraction: float = 0.0  # of the two masses, relative
    demodulator_deg: float = 0.0  # error of its phase
    gap_nm: float = 2000.0  # of the pick-up's plates
    volts_per_nm: float = 0.11  # with the gap: about 6 mV for 1 deg/s
    zero_v: float = 2.5


@dataclass(frozen=True)
class Gyroscope:
    """Three pairs; that of x senses along y, that of y along z, that of z along x. How the chip lies on the board."""

    x: Tines = field(default_factory=Tines)
    y: Tines = field(default_factory=Tines)
    z: Tines = field(default_factory=Tines)
    turn_x_deg: float = 0.0
    turn_y_deg: float = 0.0
    turn_z_deg: float = 0.0
    noise_v: float = 1.5e-3  # rms of a sample


def die(sensor: Gyroscope) -> Floats:
    """Die from board, shape (3, 3)."""
    return rotation(sensor.turn_x_deg, sensor.turn_y_deg, sensor.turn_z_deg)


@kernel
def gyroscope_v(sensor: Gyroscope, rate: Vector, load: Vector, warmer_k: float, volts: Floats) -> None:
    """Fill `volts` (3,) at a rate, deg/s, and a specific force, g, both in the die's frame."""
    volts[0] = sensed_v(sensor.x, rate[0], load[1], warmer_k)
    volts[1] = sensed_v(sensor.y, rate[1], load[2], warmer_k)
    volts[2] = sensed_v(sensor.z, rate[2], load[0], warmer_k)


@kernel
def sensed_v(tines: Tines, rate_deg_s: float, load_g: float, warmer_k: float) -> float:
    """Output of one pair at a rate about its input axis, under a load along its sense direction."""
    drive, sense = 2 * math.pi * tines.drive_hz, 2 * math.pi * (tines.drive_hz + tines.split_hz)
    swing_nm = 1e3 * tines.drive_um * (1 + 1e-6 * tines.drive_ppm_per_k * warmer_k)
    aside_nm = 1e9 * tines.unbalance_fraction * load_g * STANDARD_GRAVITY_M_S2 / sense**2
    coupled = 1e-6 * (tines.off_square_ppm + tines.off_square_per_nm * aside_nm) * sense**2
    answer_nm = swing_nm / (sense**2 - drive**2)
    coriolis_nm = 2 * math.radians(rate_deg_s) * drive * answer_nm
    error = math.radians(tines.demodulator_deg)
    moved_nm = coriolis_nm * math.cos(error) + coupled * answer_nm * math.sin(error)
    return tines.zero_v + tines.volts_per_nm * moved_nm / (1 - (moved_nm / tines.gap_nm) ** 2)


@kernel
def gyroscope_volts(
    sensor: Gyroscope, turn: Floats, rates_deg_s: Floats, loads_g: Floats, warmer_k: float, volts: Floats
) -> None:
    """Fill `volts` (n, 3) at rates and specific forces (n, 3) in the board's frame; `turn` (3, 3) is die from board."""
    for i in range(len(volts)):
        rate = across(turn, rates_deg_s[i, 0], rates_deg_s[i, 1], rates_deg_s[i, 2])
        load = across(turn, loads_g[i, 0], loads_g[i, 1], loads_g[i, 2])
        gyroscope_v(sensor, rate, load, warmer_k, volts[i])


# A magnetometer: three Hall plates on one board, with a magnet and iron that turn with them.
#
# field of the place -> changed by iron and a magnet -> part along each plate's normal -> Hall voltage -> amplifier
#
# The sensitivity of a Hall plate falls with the field (magnetoresistance) and with the temperature.


@dataclass(frozen=True)
class HallPlate:
    """One plate behind its amplifier."""

    volts_per_ut: float = 0.02
    offset_v: float = 0.0  # the contacts are not quite opposite each other
    bend_per_mt2: float = 0.0  # relative loss of sensitivity by the field along the plate
    softening_ppm_per_k: float = 0.0


@dataclass(frozen=True)
class Magnetometer:
    """The plates, how the chip lies on the board, and the magnet and iron near it, in the board's frame."""

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
def magnetometer_v(
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
    loss = plate.bend_per_mt2 * (1e-3 * b_ut) ** 2 - 1e-6 * plate.softening_ppm_per_k * warmer_k
    return plate.offset_v + plate.volts_per_ut * b_ut / (1 + loss)


@kernel
def magnetometer_volts(sensor: Magnetometer, plates: Floats, fields_ut: Floats, warmer_k: float, volts: Floats) -> None:
    """Fill `volts` (n, 3) in fields (n, 3) of the place, in the board's frame."""
    for i in range(len(volts)):
        magnetometer_v(sensor, plates, fields_ut[i, 0], fields_ut[i, 1], fields_ut[i, 2], warmer_k, volts[i])
