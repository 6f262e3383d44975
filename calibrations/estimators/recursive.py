"""Least squares, one measurement after another: what is known so far is a triangle, into which the next one is turned.

After every measurement the answer is that of all of them at once. The square root of the information is kept, not the
covariance: no start value is made up, and rounding cannot make a variance negative.

With a `forgetting` factor below 1 the weight of a measurement falls by it with each one that follows.

Source  Book (18.1)-(18.8); Bierman, Factorization Methods (1977), V; Haykin, Adaptive Filter Theory, 10: forgetting.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calibrations.estimators.least_squares import Estimate, solved
from calibrations.table import Array


@dataclass(frozen=True)
class Recursive:
    """What measurements of n unknowns have told so far: `triangle` (n + 1, n + 1) is the factor of (H, z), weighted."""

    triangle: Array
    forgetting: float = 1.0

    @classmethod
    def of(cls, unknowns: int, forgetting: float = 1.0) -> Recursive:
        """Nothing measured yet."""
        return cls(np.zeros((unknowns + 1, unknowns + 1)), forgetting)

    def after(self, row: Array, measured: float, variance: float = 1.0) -> Recursive:
        """One more measurement: `measured` = `row` x + noise of `variance`; `row` has shape (n,)."""
        new = np.append(row, measured) / np.sqrt(variance)
        stacked = np.vstack([np.sqrt(self.forgetting) * self.triangle, new])
        return replace(self, triangle=np.asarray(np.linalg.qr(stacked, mode="r")))

    def estimate(self) -> Estimate:
        """The unknowns so far. Raises TooFewRows while they are not all determined."""
        return solved(self.triangle)
