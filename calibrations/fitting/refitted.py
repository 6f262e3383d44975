"""The error on unseen rows by a fit to the others, for models of which one linear step is no such fit.

Where a few rows determine nonlinear parameters, such as the levels of a saturation, the linear step without them goes
far beyond what another fit gives: one sensor's error on unseen poses was 2.2 noise floors by the step, and 1.2 by fits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calibrations.fitting.minimise import SMALL_GAIN, newton_step
from calibrations.fitting.problem import Problem
from calibrations.means.noise import Noise, rms
from calibrations.table import Array

STEPS = 4


def unseen_error(problem: Problem, noise: Noise, theta: Array, jacobian: Array, fold: NDArray[np.intp]) -> float:
    """Pooled rms of the error on unseen rows over the noise floor; each fold is predicted by a fit to the others.

    From the parameters of all rows, `theta` (p,), the derivatives of the residual there (channels, n, p), and the fold
    of each row (n,). A parameter that the other rows do not determine is drawn to its estimate, with its typical
    magnitude as standard deviation.
    """
    error = np.empty(jacobian.shape[:2])
    for k in range(int(fold.max()) + 1):
        refitted = without_rows(problem, noise, theta, jacobian, fold == k)
        error[:, fold == k] = problem.residual(refitted)[:, fold == k]
    return float(np.sqrt(np.mean((rms(error) / noise.floor) ** 2)))


def without_rows(problem: Problem, noise: Noise, start: Array, jacobian: Array, left_out: NDArray[np.bool_]) -> Array:
    """The parameters (p,) of a fit without some rows (n,), from those of all rows on, `start`."""
    layout, (channels, n, _) = problem.layout, jacobian.shape
    has_prior = np.isfinite(layout.prior)
    drawn = np.diag(np.where(has_prior, 0.0, 1 / layout.typical))[~has_prior]

    def kept(columns: Array) -> Array:
        white = noise.whiten(columns).reshape(channels, n, -1)
        white[:, left_out] = 0.0
        return np.asarray(white.reshape(channels * n, -1))

    def white(theta: Array) -> Array:
        residual = kept(problem.residual(theta)[:, :, None])[:, 0]
        return np.concatenate([residual, layout.prior_rows @ theta, drawn @ (theta - start)])

    theta, residual = start, white(start)
    for number in range(STEPS):
        if number:
            jacobian = problem.jacobian(theta)
        slope = np.vstack([kept(jacobian), layout.prior_rows, drawn])
        theta, least = newton_step(layout, white, theta, residual, slope)
        gain = float(residual @ residual - least @ least)
        residual = least
        if gain < SMALL_GAIN * max(1.0, float(residual @ residual) / len(residual)):
            break
    return theta
