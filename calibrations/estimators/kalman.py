"""The discrete Kalman filter: unknowns that change by themselves, from measurements that are linear in them.

    x(k+1) = A x(k) + w(k)      w of covariance Q       prediction, Book (18.9)
    z(k)   = H x(k) + v(k)      v of covariance R       correction, Book (18.10)

The covariance is corrected in Joseph's form, which keeps it symmetric and positive in spite of rounding.

Source  Book (18.9)-(18.10); Bucy and Joseph, Filtering for Stochastic Processes (1968); Bar-Shalom, Li and Kirubarajan,
        Estimation with Applications to Tracking and Navigation (2001), 5.4: consistency of innovations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.table import Array


@dataclass(frozen=True)
class Belief:
    """The state of the filter: mean (..., n), covariance (..., n, n); for one filter, or for many at once."""

    mean: Array
    covariance: Array


@dataclass(frozen=True)
class Correction:
    """A belief after a measurement; the innovation (..., m), its covariance (..., m, m)."""

    belief: Belief
    innovation: Array
    innovation_covariance: Array

    @property
    def nis(self) -> Array:
        """Normalised innovation squared, (...): chi-square of m degrees of freedom where the model holds."""
        solved = np.linalg.solve(self.innovation_covariance, self.innovation[..., None])[..., 0]
        return np.asarray(np.sum(self.innovation * solved, axis=-1))

    @property
    def log_likelihood(self) -> Array:
        """Log-likelihood of the measurement, given the earlier ones, shape (...)."""
        return np.asarray(-(self.nis + np.linalg.slogdet(2 * np.pi * self.innovation_covariance)[1]) / 2)


def predict(belief: Belief, transition: Array, noise: Array) -> Belief:
    """The belief one step later: A `transition`, Q `noise`, both (..., n, n)."""
    covariance = transition @ belief.covariance @ _transpose(transition) + noise
    return Belief((transition @ belief.mean[..., None])[..., 0], (covariance + _transpose(covariance)) / 2)


def correct(belief: Belief, measured: Array, matrix: Array, noise: Array) -> Correction:
    """The belief after the measurement `measured` (..., m) = H x + v: H `matrix` (..., m, n), R `noise` (..., m, m)."""
    innovation = measured - (matrix @ belief.mean[..., None])[..., 0]
    cross = belief.covariance @ _transpose(matrix)
    covariance = matrix @ cross + noise
    gain = _transpose(np.asarray(np.linalg.solve(covariance, _transpose(cross))))
    correction = np.eye(belief.mean.shape[-1]) - gain @ matrix
    joseph = correction @ belief.covariance @ _transpose(correction) + gain @ noise @ _transpose(gain)
    mean = belief.mean + (gain @ innovation[..., None])[..., 0]
    return Correction(Belief(mean, (joseph + _transpose(joseph)) / 2), innovation, covariance)


def _transpose(matrix: Array) -> Array:
    """The transpose of the last two axes."""
    return np.swapaxes(matrix, -1, -2)
