"""The other axes, as seen from one axis, and rotations. IEEE Std 1293: input i, pendulous p, output o.

input    in plane (p)    out of plane (o)
x        y               z
y        x               z
z        x               y                  a third axis has no plane of its own: x and y in this order
"""

from __future__ import annotations

import numpy as np

from calibrations.table import Array


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
