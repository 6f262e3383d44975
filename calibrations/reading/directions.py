"""A log of a magnetometer that is turned by hand: one sample for each direction, as its magnitude needs no rest.

The sphere of directions is cut into cells of some 10 deg (a cube's faces in squares). Of the samples in a cell the
middle one in time is taken: a mean over a turn would be too short, and a long rest would outweigh the turns.
"""

from __future__ import annotations

import numpy as np

from calibrations.reading.stills import sphere_centre
from calibrations.table import Table

SQUARES = 9  # along the edge of a face


def one_for_each_direction(log: Table) -> Table:
    """The rows of `log` that stand for the cells they are in, in order."""
    u = log.outputs - sphere_centre(log.outputs)
    rows, face = np.arange(log.n), np.argmax(np.abs(u), axis=1)
    height = u[rows, face]
    size = np.where(height == 0, 1.0, np.abs(height))
    place = np.stack([u[rows, (face + k) % 3] / size for k in (1, 2)])
    square = np.clip(np.floor((place + 1) / 2 * SQUARES), 0, SQUARES - 1)
    cells = np.stack([face, height < 0, *square])
    _, cell = np.unique(cells, axis=1, return_inverse=True)
    order = np.argsort(cell.ravel(), kind="stable")
    edges = np.flatnonzero(np.diff(cell.ravel()[order], prepend=-1, append=-1))
    middle = (edges[:-1] + edges[1:] - 1) // 2
    return log.rows(np.sort(order[middle]))
