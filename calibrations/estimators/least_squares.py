"""Least squares, all measurements at once.

    z = H x + v        x = (H^T W H)^-1 H^T W z        W the inverse variances of v, 1 where they are not known

Solved by QR of the weighted H: the normal equations (18.7) would square its condition.

Source  Book (18.1)-(18.8); Grewal and Andrews, Kalman Filtering (2015), 1.2; Bierman, Factorization Methods (1977).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from calibrations.errors import TooFewRows
from calibrations.table import Array

SMALLEST = 1e-12  # of a diagonal element over the greatest, below which columns are not independent


@dataclass(frozen=True)
class Estimate:
    """Unknowns (n,), their covariance (n, n), the weighted sum of the squared residuals, and how many measurements
    there are beyond the unknowns.

    The covariance is that of the variances that were given; where none were, of a variance of 1.
    """

    values: Array
    covariance: Array
    square: float
    freedom: int

    @property
    def scattered(self) -> Array:
        """Standard errors (n,) where no variance is known: noise is what is left over. NaN where nothing is."""
        variance = self.square / self.freedom if self.freedom > 0 else np.nan
        return np.asarray(np.sqrt(variance * np.diag(self.covariance)))


def least_squares(matrix: Array, measured: Array, variances: Array | float = 1.0) -> Estimate:
    """x of `measured` = `matrix` x + noise; shapes (m, n), (m,), (m,).

    Raises TooFewRows where the measurements do not determine every unknown.
    """
    m, n = matrix.shape
    std = np.sqrt(np.broadcast_to(variances, m))
    triangle = np.asarray(np.linalg.qr(np.column_stack([matrix, measured]) / std[:, None], mode="r"))
    diagonal = np.abs(np.diag(triangle)[:n])
    if len(diagonal) < n or diagonal.min() <= SMALLEST * diagonal.max():
        raise TooFewRows(f"the measurements do not determine {n} unknowns; measure more, or at other places")
    inverse = solve_triangular(triangle[:n, :n], np.eye(n))
    left = triangle[n:, n]
    return Estimate(inverse @ triangle[:n, n], inverse @ inverse.T, float(left @ left), m - n)
