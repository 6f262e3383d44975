"""Least squares, one measurement after another: what is known so far is a triangle, into which the next one is turned.

After every measurement the answer is that of all of them at once. The square root of the information is kept, not the
covariance: no start value is made up, and rounding cannot make a variance negative.

Source  Book (18.1)-(18.8); Bierman, Factorization Methods (1977), V.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calibrations.estimators.least_squares import SMALLEST, Estimate
from calibrations.table import Array

OPEN = 1e-6  # share of an unknown in what the measurements do not tell


@dataclass(frozen=True)
class Recursive:
    """What `count` measurements of n unknowns told: `triangle` (n + 1, n + 1) is the factor of (H, z), weighted."""

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

    def estimate(self) -> Estimate:
        """The unknowns so far; NaN those that the measurements do not tell, whose sum with others may be known."""
        n = len(self.triangle) - 1
        size = np.linalg.norm(self.triangle[:, :n], axis=0)
        size[size == 0] = 1.0
        left, lengths, turned = np.linalg.svd(self.triangle[:, :n] / size, full_matrices=False)
        told = lengths > SMALLEST * lengths[0]
        back = (turned[told].T / lengths[told]) / size[:, None]
        values, covariance = back @ left[:, told].T @ self.triangle[:, n], back @ back.T
        hidden = np.any(np.abs(turned[~told]) > OPEN, axis=0)
        values[hidden], covariance[hidden], covariance[:, hidden] = np.nan, np.nan, np.nan
        rest = self.triangle[:, n] - left[:, told] @ (left[:, told].T @ self.triangle[:, n])
        return Estimate(values, covariance, float(rest @ rest), self.count - int(told.sum()))
