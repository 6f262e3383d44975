"""Error on poses that a fit has not seen: cross-validation over poses, to first order about the full fit.

All rows of one pose (both directions, repeats) are left out together, so that a left-out pose is truly unseen. Where
all rows are one pose, each row is by itself.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calibrations.geometry.orientation import one_orientation
from calibrations.means.noise import Noise, rms
from calibrations.table import Array, Table

FOLDS, MOST_FOLDS = 10, 60  # of poses, and of rows
BOUND_ROUNDS = 8
RIDGE = 1e-12  # of the products of normalised columns: some may be the same


def folds(table: Table) -> NDArray[np.intp]:
    """Fold number of each row, shape (n,); rows at the same angles share one. The same table gives the same folds."""
    names = [name for name in table.type.same_pose if name in table]
    if not names or one_orientation(table):
        return np.random.default_rng(0).permutation(table.n) % min(table.n, MOST_FOLDS)
    keys = np.column_stack([np.round(table.column(name), 6) for name in names])
    _, group = np.unique(keys, axis=0, return_inverse=True)
    groups = int(group.max()) + 1
    number = np.random.default_rng(0).permutation(groups) % min(groups, FOLDS)
    return np.asarray(number[group.ravel()])


def held_out(
    residual: Array,
    jacobian: Array,
    noise: Noise,
    fold: NDArray[np.intp],
    theta: Array,
    prior: Array,
    bounds: tuple[Array, Array],
) -> float:
    """Pooled rms of the error on unseen rows over the noise floor.

    From residual (channels, n), jacobian (channels, n, p), the fold of each row (n,), the parameters (p,), the
    standard deviation of their priors (p,), inf where there is none, and their bounds. A parameter that the other rows
    determine badly, such as the loss of a saturation, keeps within its bounds.
    """
    channels, n, p = jacobian.shape
    size = np.linalg.norm(jacobian.reshape(channels * n, p), axis=0)
    size = np.where(size > 0, size, 1.0)
    J = jacobian / size
    white = noise.whiten(np.concatenate([J, residual[:, :, None]], axis=2)).reshape(channels, n, p + 1)
    total = np.einsum("cni,cnj->ij", white, white)
    precision = 1 / (prior * size) ** 2
    ridge = RIDGE * np.trace(total[:p, :p]) / max(p, 1) * np.eye(p) + np.diag(precision)
    pulled = precision * theta * size  # towards the mean of the prior
    low, high = ((bound - theta) * size for bound in bounds)
    error = np.empty_like(residual)
    for k in range(int(fold.max()) + 1):
        rows = fold == k
        part = white[:, rows].reshape(-1, p + 1)
        G = total - part.T @ part
        change = _solve_within_bounds(G[:p, :p] + ridge, G[:p, p] + pulled, low, high)
        error[:, rows] = residual[:, rows] - J[:, rows] @ change
    return float(np.sqrt(np.mean((rms(error) / noise.floor) ** 2)))


def parameters_of_rows(columns: Array, prior: Array) -> float:
    """The number of parameters that the rows determine and their priors do not: the trace of the projection.

    From whitened derivatives (rows, p) and the standard deviations of the priors (p,), inf where there is none.
    """
    size = np.linalg.norm(columns, axis=0)
    size = np.where(size > 0, size, 1.0)
    products = (columns / size).T @ (columns / size)
    precision = 1 / (prior * size) ** 2
    return float(np.trace(np.linalg.solve(products + np.diag(precision + RIDGE), products)))


def _solve_within_bounds(products: Array, side: Array, low: Array, high: Array) -> Array:
    """The least-squares change (p,) within its bounds: an entry beyond its bound stays there, the others follow."""
    change = np.linalg.solve(products, side)
    free = np.ones(len(side), dtype=bool)
    for _ in range(BOUND_ROUNDS):
        out_of_bounds = free & ((change < low) | (change > high))
        if not out_of_bounds.any():
            break
        change = np.clip(change, low, high)
        free &= ~out_of_bounds
        follows = side[free] - products[np.ix_(free, ~free)] @ change[~free]
        change[free] = np.linalg.solve(products[np.ix_(free, free)], follows)
    return np.asarray(np.clip(change, low, high))
