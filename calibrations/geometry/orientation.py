"""Orientation: the stages' pose, the specific force in it, rotations, and the axes as seen from one axis.

IEEE Std 1293: input i, pendulous p, output o.

input    in plane (p)    out of plane (o)
x        y               z
y        x               z
z        x               y                  a third axis has no plane of its own: x and y in this order
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from calibrations.criteria import SAME_G
from calibrations.table import Array, Table

UPRIGHT_DEG = {"x": (0.0, 180.0), "y": (90.0, 270.0)}  # beta at +1 g and at -1 g, with alpha at 90 deg


@dataclass(frozen=True)
class Pose:
    """True stage angles and the true vertical. Angles in rad, shape (n,).

    `up` is a unit vector, (3,), or one of each pose, (3, n).
    """

    alpha: Array
    beta: Array
    mount: Array
    flip: Array
    up: Array


@lru_cache(maxsize=2)
def nominal_pose(table: Table) -> Pose:
    """The pose that the stages report; horizontal for a table of motion without one."""
    return Pose(
        np.radians(table.optional("alpha_deg", 0.0)),
        np.radians(table.optional("beta_deg", 0.0)),
        np.radians(table.optional("mount_deg", 0.0)),
        table.optional("flip", 0.0),
        np.array([0.0, 0.0, 1.0]),
    )


@lru_cache(maxsize=4)
def reported_force(table: Table) -> Array:
    """Static specific force at the poses that the stages report, g, shape (n, 3)."""
    return specific_force(nominal_pose(table))


@lru_cache(maxsize=8)
def one_orientation(table: Table) -> bool:
    """Whether the specific force is the same in all rows of a table with stage angles: a sensor at rest."""
    return table.type.stage_angles and bool(np.all(np.ptp(reported_force(table), axis=0) < SAME_G))


def specific_force(pose: Pose) -> Array:
    """Static specific force in the sensor frame, g, shape (n, 3): a = F Rz(mount) Rz(beta) Ry(alpha) up."""
    ca, sa = np.cos(pose.alpha), np.sin(pose.alpha)
    turn = pose.beta + pose.mount
    ux, uy, uz = pose.up
    x, y, z = ca * ux + sa * uz, uy, -sa * ux + ca * uz
    cb, sb = np.cos(turn), np.sin(turn)
    side = np.where(pose.flip > 0, -1.0, 1.0)
    return np.column_stack([cb * x - sb * y, side * (sb * x + cb * y), side * z])


def other_in_plane(a: Array) -> Array:
    """For each axis the specific force along the other in-plane axis, shape (n, 3)."""
    return a[:, [1, 0, 0]]


def out_of_plane(a: Array) -> Array:
    """For each axis the specific force along the out-of-plane axis, shape (n, 3)."""
    return a[:, [2, 2, 1]]


def rotation(vector: Array) -> Array:
    """Rotation matrix of a rotation vector in rad (Rodrigues), shape (3, 3)."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    K: Array = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    first, second = (np.sin(angle) / angle, (1 - np.cos(angle)) / angle**2) if angle > 1e-8 else (1.0, 0.5)
    R: Array = np.eye(3) + first * K + second * (K @ K)
    return R
