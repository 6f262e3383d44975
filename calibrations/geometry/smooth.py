"""Possible outputs of any static sensor: smooth functions of the direction of gravity, and of the side of approach.

Slow noise is fitted together with these columns: a misfit of the model repeats with the angles, and noise does not. So
the misfit does not count as noise. This is the pure error of a lack-of-fit test, with smoothness in place of repeats.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import scipy  # scipy.linalg loads slowly: it is imported at its first use

from calibrations.geometry.orientation import reported_force
from calibrations.table import Array, Table

DEGREE = 5
DIRECTION_DEGREE = 3
ROWS_PER_COLUMN = 5  # the least number of rows for each column


@lru_cache(maxsize=8)
def smooth_columns(table: Table) -> Array:
    """Spherical harmonics of the direction of gravity, as polynomials, and the same times direction, shape (n, k).

    For motion, what a sensor could do alike in every stretch at one attitude. No columns for tables of unknown
    orientation, nor for fewer rows than the lowest degree needs.
    """
    columns = COLUMNS.get(table.content)
    return np.zeros((table.n, 0)) if columns is None else columns(table)


def _directions(table: Table) -> Array:
    """Polynomials of the direction of gravity, of the highest degree that the rows allow."""
    a = reported_force(table)
    most = table.n // ROWS_PER_COLUMN
    for degree in range(DEGREE, 0, -1):
        columns = np.column_stack(list(_harmonics(a, degree)))
        if "direction" in table:
            turning = table.column("direction")[:, None]
            by_direction = np.column_stack(list(_harmonics(a, min(degree, DIRECTION_DEGREE))))
            columns = np.hstack([columns, turning * by_direction])
        basis = _orthonormal(columns)
        if basis.shape[1] <= most:
            return basis
    return np.zeros((table.n, 0))


def _attitudes(table: Table) -> Array:
    """One column for each attitude, 1 where the sensor was in it."""
    angles = np.column_stack([table.optional(name, 0.0) for name in ("alpha_deg", "beta_deg", "mount_deg", "flip")])
    _, group = np.unique(angles, axis=0, return_inverse=True)
    columns: Array = (group.ravel()[:, None] == np.arange(group.max() + 1)) * 1.0
    return columns if columns.shape[1] <= table.n // ROWS_PER_COLUMN else columns[:, :0]


def _harmonics(a: Array, degree: int) -> Iterator[Array]:
    """Monomials that span the spherical harmonics up to `degree`: z at most once, as x^2 + y^2 + z^2 = 1."""
    x, y, z = a.T
    for total in range(degree + 1):
        for i in range(total + 1):
            yield x**i * y ** (total - i)
            if total < degree:
                yield x**i * y ** (total - i) * z


def _orthonormal(columns: Array) -> Array:
    Q, R, _ = scipy.linalg.qr(columns, mode="economic", pivoting=True)
    size = np.abs(np.diag(R))
    return np.asarray(Q[:, size > 1e-8 * size[0]])


COLUMNS = {"poses": _directions, "motion": _attitudes}
