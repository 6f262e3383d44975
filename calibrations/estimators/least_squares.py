"""Least squares: of all measurements at once, and recursive.

    z = H x + v        x = (H^T W H)^-1 H^T W z        W the inverse variances of v, 1 where they are not known

Solved by QR of the weighted H: the normal equations (18.7) would square its condition.

Source  Book (18.1)-(18.8); Grewal and Andrews, Kalman Filtering (2015), 1.2; Bierman, Factorization Methods (1977).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import brentq

from calibrations.errors import TooFewRows
from calibrations.table import Array

SMALLEST_DIAGONAL = 1e-12  # of a diagonal element over the greatest, below which columns are not independent


@dataclass(frozen=True)
class LinearEstimate:
    """Estimated unknowns of a linear equation.

    values      shape (n,)
    covariance  shape (n, n), by the given variances of the measurements; by a variance of 1 if none were given
    square      weighted sum of the squared residuals
    freedom     number of measurements beyond the unknowns
    """

    values: Array
    covariance: Array
    square: float
    freedom: int

    @property
    def scattered(self) -> Array:
        """Standard errors (n,) by the variance of the residual; NaN without a residual."""
        variance = self.square / self.freedom if self.freedom > 0 else np.nan
        return np.asarray(np.sqrt(variance * np.diag(self.covariance)))


def least_squares(matrix: Array, measured: Array, variances: Array | float = 1.0) -> LinearEstimate:
    """x of `measured` = `matrix` x + noise; shapes (m, n), (m,), (m,).

    Raises TooFewRows where the measurements do not determine every unknown.
    """
    m, n = matrix.shape
    std = np.sqrt(np.broadcast_to(variances, m))
    triangle = np.asarray(np.linalg.qr(np.column_stack([matrix, measured]) / std[:, None], mode="r"))
    diagonal = np.abs(np.diag(triangle)[:n])
    if len(diagonal) < n or diagonal.min() <= SMALLEST_DIAGONAL * diagonal.max():
        raise TooFewRows(f"the measurements do not determine {n} unknowns; measure more, or at other conditions")
    inverse = solve_triangular(triangle[:n, :n], np.eye(n))
    residual = triangle[n:, n]
    return LinearEstimate(inverse @ triangle[:n, n], inverse @ inverse.T, float(residual @ residual), m - n)


def shortest_solution(matrix: Array, measured: Array, variances: Array) -> LinearEstimate:
    """`least_squares` for columns that may depend on each other: the solution of least length."""
    weight = 1 / np.sqrt(variances)
    weighted, values = matrix * weight[:, None], measured * weight
    covariance = np.asarray(np.linalg.pinv(weighted.T @ weighted, rcond=1e-10, hermitian=True))
    solution = covariance @ (weighted.T @ values)
    square = float(np.sum((values - weighted @ solution) ** 2))
    return LinearEstimate(solution, covariance, square, len(measured) - int(np.linalg.matrix_rank(weighted)))


def between_variance(matrix: Array, measured: Array, variances: Array, freedom: int) -> float:
    """The variance that, added to `variances`, makes the weighted sum of squares equal `freedom`; 0 where it is less.

    Source  Mandel and Paule, Anal. Chem. 42 (1970).
    """

    def excess(extra_variance: float) -> float:
        return shortest_solution(matrix, measured, variances + extra_variance).square - freedom

    if excess(0.0) <= 0:
        return 0.0
    high = float(np.var(measured)) + float(np.max(variances))
    while excess(high) > 0:
        high *= 4
    return float(brentq(excess, 0.0, high, rtol=1e-9))


# Recursive least squares: a triangular matrix has the information so far; a rotation adds the next measurement to it.
#
# After every measurement the solution equals that of all measurements at once. The state is the square root of the
# information, not the covariance: it needs no start value, and rounding cannot make a variance negative.
#
# Source  Book (18.1)-(18.8); Bierman, Factorization Methods (1977), V.

UNDETERMINED_SHARE = 1e-6  # share of an unknown in the undetermined directions


@dataclass(frozen=True)
class Recursive:
    """Information of `count` measurements on n unknowns; `triangle` (n + 1, n + 1): factor of (H, z), weighted."""

    triangle: Array
    count: int = 0

    @classmethod
    def of(cls, unknowns: int) -> Recursive:
        """Nothing measured yet."""
        return cls(np.zeros((unknowns + 1, unknowns + 1)))

    def after(self, row: Array, measured: float, variance: float = 1.0) -> Recursive:
        """One more measurement: `measured` = `row` x + noise of `variance`; `row` has shape (n,)."""
        new = np.append(row, measured) / np.sqrt(variance)
        triangle = np.asarray(np.linalg.qr(np.vstack([self.triangle, new]), mode="r"))
        return replace(self, triangle=triangle, count=self.count + 1)

    def estimate(self) -> LinearEstimate:
        """The unknowns so far; NaN for an undetermined one, even if a sum with it is determined."""
        n = len(self.triangle) - 1
        size = np.linalg.norm(self.triangle[:, :n], axis=0)
        size[size == 0] = 1.0
        left_vectors, lengths, turned = np.linalg.svd(self.triangle[:, :n] / size, full_matrices=False)
        determined = lengths > SMALLEST_DIAGONAL * lengths[0]
        inverse = (turned[determined].T / lengths[determined]) / size[:, None]
        values, covariance = inverse @ left_vectors[:, determined].T @ self.triangle[:, n], inverse @ inverse.T
        undetermined = np.any(np.abs(turned[~determined]) > UNDETERMINED_SHARE, axis=0)
        values[undetermined], covariance[undetermined], covariance[:, undetermined] = np.nan, np.nan, np.nan
        residual = self.triangle[:, n] - left_vectors[:, determined] @ (
            left_vectors[:, determined].T @ self.triangle[:, n]
        )
        return LinearEstimate(values, covariance, float(residual @ residual), self.count - int(determined.sum()))
