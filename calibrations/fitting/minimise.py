"""Least squares under given noise: at once where the model is linear, else by damped steps within bounds."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import scipy  # scipy.optimize loads slowly: it is imported at its first use
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, lstsq, qr

from calibrations.fitting.identifiability import RELATIVE_RANK
from calibrations.fitting.problem import Problem
from calibrations.means.noise import Noise
from calibrations.model.parameters import Layout
from calibrations.table import Array

NEWTON_STEPS = 20
DAMPINGS = (0.0, 1e-3, 1e-2, 0.1, 1.0, 10.0)  # of each column's squares
BOUND_ROUNDS = 3
LARGEST_FACTOR = 2.0  # by which one step changes a parameter that is positive by its meaning
STRAIGHT = 1e-6  # of the residual: the model is linear where one step predicts the residual better
IDLE = 1e-9  # of the largest column: a parameter with less changes nothing
SMALL_GAIN = 3e-3  # of the mean square of the residual or the noise: a parameter moves by 0.05 uncertainties


def minimise(problem: Problem, noise: Noise, start: Array) -> tuple[Array, float]:
    """(parameters, cost) of least squares under `noise`."""
    if not len(start):
        return start, 0.0
    if problem.keeps_starts or len(problem.layout.prior_rows):
        return _minimise_determined(problem, noise, start)
    at_once = _at_once(problem, noise, start) if problem.adds else None
    if at_once is not None:
        return at_once

    rows = problem.layout.prior_rows

    def descend(start: Array, stairs: bool) -> scipy.optimize.OptimizeResult:
        def jacobian(theta: Array) -> Array:
            return np.vstack([noise.whiten(problem.jacobian(theta, stairs=stairs)), rows])

        return scipy.optimize.least_squares(
            partial(_white_residual, problem, noise),
            start,
            jac=jacobian,
            bounds=problem.layout.bounds,
            x_scale=problem.layout.typical,
            ftol=1e-9,
            xtol=1e-9,
            gtol=1e-12,
            max_nfev=60,
        )

    answer = descend(start, stairs=False)
    if problem.rounds:
        answer = descend(answer.x, stairs=True)
    return answer.x, float(answer.cost)


def _at_once(problem: Problem, noise: Noise, start: Array) -> tuple[Array, float] | None:
    """Minimise in one Gauss-Newton step, which suffices for a linear model. None if the model is not linear.

    A time constant changes nothing while its amplitude is 0. A step that changes the amplitude leaves it to be fitted.
    """
    typical, (low, high) = problem.layout.typical, problem.layout.bounds
    columns = np.concatenate([problem.residual(start)[:, :, None], problem.jacobian(start)], axis=2)
    rows = problem.layout.prior_rows
    white = np.vstack([noise.whiten(columns), np.column_stack([rows @ start, rows])])
    J, start_residual = white[:, 1:] * typical, white[:, 0]
    step = np.linalg.lstsq(J, -start_residual, rcond=None)[0]
    theta = start + typical * step
    if np.any(theta < low) or np.any(theta > high):
        return None
    end_residual = _white_residual(problem, noise, theta)
    if np.linalg.norm(start_residual + J @ step - end_residual) > STRAIGHT * np.linalg.norm(end_residual):
        return None
    sizes = np.linalg.norm(J, axis=0)
    idle = sizes <= IDLE * sizes.max()
    if idle.any():
        idle_columns = noise.whiten(problem.jacobian(theta, of=idle)) * typical[idle]
        if np.any(np.linalg.norm(idle_columns, axis=0) > IDLE * sizes.max()):
            return None
    return theta, float(end_residual @ end_residual) / 2


def _white_residual(problem: Problem, noise: Noise, theta: Array) -> Array:
    """The residual made white, and the priors of the parameters below it, shape (rows,)."""
    return np.append(noise.whiten(problem.residual(theta)[:, :, None])[:, 0], problem.layout.prior_rows @ theta)


def _minimise_determined(problem: Problem, noise: Noise, start: Array) -> tuple[Array, float]:
    """Minimise by the shortest Gauss-Newton steps, damped where they fail (Levenberg and Marquardt).

    Parameters that the data do not determine keep their start values.
    """
    white = partial(_white_residual, problem, noise)
    theta, residual = start, white(start)
    stairs = False
    for _ in range(NEWTON_STEPS):
        slope = np.vstack([noise.whiten(problem.jacobian(theta, stairs=stairs)), problem.layout.prior_rows])
        candidate, candidate_residual = newton_step(problem.layout, white, theta, residual, slope)
        gain = float(residual @ residual - candidate_residual @ candidate_residual)
        theta, residual = candidate, candidate_residual
        if gain < SMALL_GAIN * max(1.0, float(residual @ residual) / len(residual)):
            if stairs or not problem.rounds:
                break
            stairs = True
    return theta, float(residual @ residual) / 2


def newton_step(
    layout: Layout, white: Callable[[Array], Array], theta: Array, residual: Array, slope: Array
) -> tuple[Array, Array]:
    """Parameters (p,) with a smaller residual, and this residual (rows,); both as given where no step makes it smaller.

    white  the residual as a function of the parameters; `residual` and its derivatives `slope` (rows, p) are at `theta`
    """
    typical, J = layout.typical, slope * layout.typical
    low, high = ((bound - theta) / typical for bound in _reach(layout, theta))
    # a rotation of the rows changes no step, and leaves as many rows as columns for every damping
    rotated = qr(np.column_stack([J, residual]), mode="r", overwrite_a=True, check_finite=False)[0]
    R: Array = np.asarray(rotated[: J.shape[1] + 1], dtype=np.float64)
    squares = R[:, :-1].T @ R
    for damping in DAMPINGS:
        solve = partial(_damped, squares, damping) if damping else partial(_shortest, R)
        candidate = theta + typical * _within(solve, low, high)
        candidate_residual = white(candidate)
        if float(residual @ residual - candidate_residual @ candidate_residual) > 0:
            return candidate, candidate_residual
    return theta, residual


def _reach(layout: Layout, theta: Array) -> tuple[Array, Array]:
    """The least and greatest values that one step may give.

    What is positive by its meaning, such as a time constant, changes by a factor. Derivatives hold within a small one.
    """
    low, high = layout.bounds
    positive = (low > 0) & (theta > 0)
    return (
        np.where(positive, np.maximum(low, theta / LARGEST_FACTOR), low),
        np.where(positive, np.minimum(high, theta * LARGEST_FACTOR), high),
    )


def _within(solve: Callable[[Array, NDArray[np.bool_]], Array], low: Array, high: Array) -> Array:
    """The step (p,) within bounds: an entry beyond its bound is set to the bound, and the others are solved again.

    solve  a function of a step (p,) and the mask (p,) of its free entries; it returns the free entries (k,), with the
           other entries of the step held
    """
    step = np.zeros(len(low))
    free = np.ones(len(step), dtype=bool)
    for _ in range(BOUND_ROUNDS):
        step[free] = solve(step, free)
        out_of_bounds = free & ((step < low) | (step > high))
        if not out_of_bounds.any():
            break
        step = np.clip(step, low, high)
        free &= ~out_of_bounds
    return np.asarray(np.clip(step, low, high))


def _shortest(R: Array, step: Array, free: NDArray[np.bool_]) -> Array:
    """The shortest of the steps that leave least, by the rotated columns and residual R, (p + 1, p + 1)."""
    columns, side = R[:, :-1][:, free], R[:, -1] + R[:, :-1][:, ~free] @ step[~free]
    most = float(np.linalg.norm(columns, axis=0).max(initial=0.0)) or 1.0
    # by orthogonal factors: singular values need not converge on free forms of hundreds of columns
    shortest = lstsq(columns / most, -side / most, cond=RELATIVE_RANK, lapack_driver="gelsy", check_finite=False)[0]
    return np.asarray(shortest)


def _damped(squares: Array, damping: float, step: Array, free: NDArray[np.bool_]) -> Array:
    """The damped step by the sums of squares and products of the columns, and of them and the residual, (p, p + 1).

    Damping makes the normal equations of columns of one length well conditioned, so that they can be solved as such.
    """
    normal, side = squares[:, :-1], squares[free, -1] + squares[free][:, :-1][:, ~free] @ step[~free]
    size = np.sqrt(np.diag(normal)[free])
    moving = size > RELATIVE_RANK * size.max(initial=0.0)
    answer, size = np.zeros(len(size)), size[moving]
    scaled = normal[np.ix_(free, free)][np.ix_(moving, moving)] / np.outer(size, size)
    factor = cho_factor(scaled + damping * np.eye(len(size)), lower=True, overwrite_a=True, check_finite=False)
    answer[moving] = cho_solve(factor, -side[moving] / size, check_finite=False) / size
    return answer
