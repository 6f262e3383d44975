"""The error on unseen rows by a fit to the others, for models of which one linear step is no such fit.

Where a few rows determine nonlinear parameters, such as the levels of a saturation, the linear step without them goes
far beyond what another fit gives: one sensor's error on unseen poses was 2.8 noise floors by the step, and 1.1 by fits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calibrations.fitting.minimise import newton_step
from calibrations.fitting.solution import Solution, folds
from calibrations.means.noise import rms
from calibrations.table import Array

STEPS = 4
SMALL_GAIN = 3e-3  # of the mean square of the residual or the noise


def unseen_error(solution: Solution) -> float:
    """Pooled rms of the error on unseen rows over the noise floor; each fold is predicted by a fit to the others.

    A parameter that the other rows do not determine is drawn to its estimate, with its typical magnitude as standard
    deviation, as in `solution.held_out`.
    """
    fold = folds(solution.table)
    error = np.empty_like(solution.residual)
    for k in range(int(fold.max()) + 1):
        theta = _without_rows(solution, fold == k)
        error[:, fold == k] = solution.problem.residual(theta)[:, fold == k]
    return float(np.sqrt(np.mean((rms(error) / solution.noise.floor) ** 2)))


def _without_rows(solution: Solution, left_out: NDArray[np.bool_]) -> Array:
    """The parameters (p,) of a fit without some rows (n,), from those of all rows on."""
    problem, noise, layout = solution.problem, solution.noise, solution.problem.layout
    channels, n = solution.residual.shape
    has_prior = np.isfinite(layout.prior)
    drawn = np.diag(np.where(has_prior, 0.0, 1 / layout.typical))[~has_prior]

    def kept(columns: Array) -> Array:
        white = noise.whiten(columns).reshape(channels, n, -1)
        white[:, left_out] = 0.0
        return np.asarray(white.reshape(channels * n, -1))

    def white(theta: Array) -> Array:
        residual = kept(problem.residual(theta)[:, :, None])[:, 0]
        return np.concatenate([residual, layout.prior_rows @ theta, drawn @ (theta - solution.theta)])

    theta, residual, jacobian = solution.theta, white(solution.theta), solution.jacobian
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
