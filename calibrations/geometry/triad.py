"""An accelerometer of unknown calibration at rest: its zero and matrix by the magnitude of gravity, and the directions.

    u = K (v - b), |u| = 1        K is lower triangular: x is kept, and y is in the plane of x and y

Source  Tedaldi, Pretto and Menegatti, ICRA 2014; Skog and Haendel, XVII IMEKO World Congress (2006).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from calibrations.geometry.sphere import sphere_centre, unit_vectors
from calibrations.table import Array

LOWER = np.tril_indices(3)
FEWEST_RESTS = 9  # parameters


def gravity_directions(means: Array) -> Array:
    """Directions upward, unit vectors (n, 3), from the mean outputs of rests in different orientations (n, 3).

    With fewer than FEWEST_RESTS rests all axes count as square to each other and of one scale factor.
    """
    centre = sphere_centre(means)
    size = float(np.mean(np.linalg.norm(means - centre, axis=1))) or 1.0
    scaled = (means - centre) / size
    if len(means) <= FEWEST_RESTS:
        return unit_vectors(scaled)

    def residual(theta: Array) -> Array:
        return np.asarray(np.linalg.norm(_correct(scaled, theta), axis=1) - 1)

    start = np.concatenate([np.zeros(3), np.eye(3)[LOWER]])
    return unit_vectors(_correct(scaled, least_squares(residual, start).x))


def _correct(scaled: Array, theta: Array) -> Array:
    matrix = np.zeros((3, 3))
    matrix[LOWER] = theta[3:]
    return np.asarray((scaled - theta[:3]) @ matrix.T)
