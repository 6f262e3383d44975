"""The other axes, as seen from one axis, and rotations. IEEE Std 1293: input i, pendulous p, output o.

input    in plane (p)    out of plane (o)
x        y               z
y        x               z
z        x               y                  a third axis has no plane of its own: x and y in this order
"""

from __future__ import annotations

import numpy as np

from calibrations.table import Array, Table


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


def approached_from(a: Array, table: Table) -> Array:
    """Specific force a little before each pose was reached: beta turned back by the approach, shape (n, 3).

    The approach is the table's constant `approach_deg`. Where it is not given, rows with a time were reached straight
    from the row before; without a time, the direction is all that is known, and a step of 10 deg is assumed.
    """
    approach = table.number("approach_deg", 0.0 if "t_s" in table else 10.0)
    side = np.where(table.optional("flip", 0.0) > 0, -1.0, 1.0)
    back = -np.radians(approach) * table.column("direction") * side
    c, s = np.cos(back), np.sin(back)
    return np.column_stack([c * a[:, 0] - s * a[:, 1], s * a[:, 0] + c * a[:, 1], a[:, 2]])
