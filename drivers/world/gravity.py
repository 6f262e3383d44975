"""Gravity in the frame of the sensor's package: base, stages, mount, package; a level on the table; each mounting.

    a = P E F Rz(mount) Rz(beta) Ry(alpha) up        in g, with the true angles

`up` is the vertical in the base (tilted by two angles), F turns the sensor face down, E puts it on an edge, P is the
package's own small rotation on its mount. At rest the specific force is 1 g upward.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from drivers.world.kernel import Floats, kernel


@dataclass(frozen=True)
class Base:
    """Orientation of the rig's base in the laboratory."""

    tilt_x_deg: float = 0.0  # turn of the base about its x axis
    tilt_y_deg: float = 0.0  # turn of the base about its y axis


@dataclass(frozen=True)
class Package:
    """Small rotations of the package on its mount, applied about x, then y, then z; beams off square."""

    turn_x_deg: float = 0.0
    turn_y_deg: float = 0.0
    turn_z_deg: float = 0.0
    beams_off_square_deg: float = 0.0  # how far the y beam is turned from 90 deg toward the x beam


def rotation(x_deg: float, y_deg: float, z_deg: float) -> Floats:
    """Rz Ry Rx, shape (3, 3)."""
    (a, b, c), (p, q, r) = np.cos(np.radians([x_deg, y_deg, z_deg])), np.sin(np.radians([x_deg, y_deg, z_deg]))
    about_x = np.array([[1, 0, 0], [0, a, -p], [0, p, a]])
    about_y = np.array([[b, 0, q], [0, 1, 0], [-q, 0, b]])
    about_z = np.array([[c, -r, 0], [r, c, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def vertical(base: Base) -> Floats:
    """The upward vertical in the frame of the base, shape (3,)."""
    return rotation(base.tilt_x_deg, base.tilt_y_deg, 0.0)[:, 2]


def mounting(package: Package, mount_deg: float, flip: int, up: str = "z") -> Floats:
    """Package from table, shape (3, 3): the mount's turn, face down if `flip`, on edge, the package's own rotation.

    `up` names the edge along the table's normal; with x up, y and z lie along the table's x and y.
    """
    face = np.diag([1.0, -1.0, -1.0]) if flip else np.eye(3)
    edge = np.roll(np.eye(3), "zxy".index(up), axis=0)
    turned = rotation(package.turn_x_deg, package.turn_y_deg, package.turn_z_deg)
    return np.asarray(turned @ edge @ face @ rotation(0, 0, mount_deg))


@kernel
def along_y(package: Package, gx: float, gy: float) -> float:
    """Load along the y beam, which need not be square to the x beam."""
    off = math.radians(package.beams_off_square_deg)
    return gy * math.cos(off) + gx * math.sin(off)


@kernel
def felt_g(up: Floats, mount: Floats, alpha_rad: float, beta_rad: float) -> tuple[float, float, float]:
    """Specific force in the package's frame, in g, at true stage angles; any other vector of the base alike."""
    ca, sa = math.cos(alpha_rad), math.sin(alpha_rad)
    cb, sb = math.cos(beta_rad), math.sin(beta_rad)
    x, y, z = ca * up[0] + sa * up[2], up[1], ca * up[2] - sa * up[0]
    x, y = cb * x - sb * y, sb * x + cb * y
    return across(mount, x, y, z)


@kernel
def across(turn: Floats, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A vector in another frame, `turn` (3, 3) from its own. Numbers, as arrays would be allocated at every tick."""
    return (
        turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z,
        turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z,
        turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z,
    )


# A digital level on the turntable: the angle between the surface of its liquid and the plate below it.
#
# The surface is perpendicular to the specific force. The reading of an axis is the elevation of its positive end:
# atan2(a_x, a_z) and atan2(a_y, a_z), more than 90 deg upside down.

PLATE_AXES = np.eye(3)


@dataclass(frozen=True)
class LevelErrors:
    """Errors of the level itself."""

    offset_x_deg: float = 0.0  # its reading on a level plate
    offset_y_deg: float = 0.0
    noise_deg: float = 0.003  # rms of one reading


def inclination_deg(up: Floats, alpha_rad: float, beta_rad: float) -> tuple[float, float]:
    """True inclination of the plate's x and y axis, in deg: the vertical in the base, the stages' true angles."""
    x, y, z = felt_g(up, PLATE_AXES, alpha_rad, beta_rad)
    return math.degrees(math.atan2(x, z)), math.degrees(math.atan2(y, z))


def shown_deg(level: LevelErrors, inclined_deg: tuple[float, float], seed: int, t_ns: int) -> tuple[float, float]:
    """The reading of the level. Its noise depends on seed and time only, so a reading disturbs nothing."""
    noise = level.noise_deg * np.random.default_rng([seed, 3, t_ns]).standard_normal(2)
    x, y = inclined_deg
    return float(x + level.offset_x_deg + noise[0]), float(y + level.offset_y_deg + noise[1])


# Every mounting differs: the seat of the plate on the table, and the force of the clamp on the package.
#
# The clamp bends the package, which displaces the proof mass. Each sensor of a batch has its own clamp on one plate.

TILT, GRIP = 4, 5  # parts of the seeds: for the plate, and for each clamp


@dataclass(frozen=True)
class Seating:
    """Standard deviations from one mounting to the next."""

    tilt_deg: float = 0.0  # of the plate, about each of its axes
    grip_pm: float = 0.0  # displacement of the mass along each sensing axis


def seat_mounting(seating: Seating, seed: int, place: int, now_ns: int) -> tuple[Floats, Floats]:
    """(rotation of the plate, displacement in nm) of a mounting at `now_ns`; time and seed alone settle it."""
    tilts_deg = seating.tilt_deg * np.random.default_rng([seed, TILT, now_ns]).standard_normal(3)
    grips_pm = seating.grip_pm * np.random.default_rng([seed, GRIP, now_ns, place]).standard_normal(2)
    return rotation(*tilts_deg), 1e-3 * grips_pm
