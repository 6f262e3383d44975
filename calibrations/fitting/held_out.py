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
    residual: Array, jacobian: Array, noise: Noise, fold: NDArray[np.intp], theta: Array, prior: Array
) -> float:
    """Pooled rms of the error on unseen rows over the noise floor.

    From residual (channels, n), jacobian (channels, n, p), the fold of each row (n,), the parameters (p,) and the
    standard deviation of their priors (p,), inf where there is none.
    """
    channels, n, p = jacobian.shape
    size = np.linalg.norm(jacobian.reshape(channels * n, p), axis=0)
    J = jacobian / np.where(size > 0, size, 1.0)
    white = noise.whiten(np.concatenate([J, residual[:, :, None]], axis=2)).reshape(channels, n, p + 1)
    total = np.einsum("cni,cnj->ij", white, white)
    precision = 1 / (prior * np.where(size > 0, size, 1.0)) ** 2
    ridge = 1e-12 * np.trace(total[:p, :p]) / max(p, 1) * np.eye(p) + np.diag(precision)
    pulled = precision * theta * size  # towards the mean of the prior
    error = np.empty_like(residual)
    for k in range(int(fold.max()) + 1):
        rows = fold == k
        part = white[:, rows].reshape(-1, p + 1)
        G = total - part.T @ part
        change = np.linalg.solve(G[:p, :p] + ridge, G[:p, p] + pulled)
        error[:, rows] = residual[:, rows] - J[:, rows] @ change
    return float(np.sqrt(np.mean((rms(error) / noise.floor) ** 2)))
