"""The solution of a least-squares problem under given noise, and the figures that follow from it.

The error on unseen poses is that of a cross-validation over poses, to first order about the full fit where that is
enough. All rows of one pose (both directions, repeats) are left out together, so that a left-out pose is truly unseen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from calibrations.criteria import FEWEST_VISITS
from calibrations.fitting.problem import Problem
from calibrations.geometry.orientation import one_orientation
from calibrations.means.noise import Noise, rms, white_only
from calibrations.table import Array, Table

FOLDS, MOST_FOLDS = 10, 60  # of poses, and of rows
BOUND_ROUNDS = 8
FAR = 1.05  # of the generalised cross-validation: a larger error on unseen rows is that of few rows
RIDGE = 1e-12  # of the products of normalised columns: some may be the same


@dataclass(frozen=True, eq=False, repr=False)
class Solution:
    """Parameters `theta` (p,), their residual (channels, n) and jacobian (channels, n, p); rows in order of time."""

    problem: Problem
    theta: Array
    noise: Noise
    residual: Array
    jacobian: Array

    @property
    def table(self) -> Table:
        """The table, rows in order of time."""
        return self.problem.table

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the residual's blocks."""
        return self.problem.channels

    @property
    def rmse(self) -> Array:
        """Root mean square of the residual per channel."""
        return rms(self.residual)

    @property
    def excess(self) -> Array:
        """Normalised rms residual per channel: rmse over noise floor."""
        return rms(self.residual) / self.noise.floor

    @property
    def pooled_excess(self) -> float:
        """The excess over all channels together."""
        return float(np.sqrt(np.mean(self.excess**2)))

    @cached_property
    def held_out_excess(self) -> float:
        """Pooled rms of the error on unseen rows over the noise floor.

        It is at least that on the rows of the fit. Where the linear step promises less, the fit is not at a minimum.
        Where the linear step goes far, a fit without the rows takes its place.
        """
        error = self.held_out_with(np.zeros((*self.residual.shape, 0)))
        if error > FAR * self.cross_validated_excess and not self.problem.adds:
            from calibrations.fitting.refitted import unseen_error  # few models need it

            error = unseen_error(self.problem, self.noise, self.theta, self.jacobian, folds(self.table))
        return max(error, self.pooled_excess)

    def held_out_with(self, extra: Array) -> float:
        """The held-out error with columns (channels, n, k) added to the fit."""
        jacobian = np.concatenate([self.jacobian, extra], axis=2)
        theta = np.append(self.theta, np.zeros(extra.shape[2]))
        no_bound = np.full(extra.shape[2], np.inf)
        low, high = self.problem.layout.bounds
        bounds = np.append(low, -no_bound), np.append(high, no_bound)
        prior = np.append(self.problem.layout.prior, no_bound)
        reach = np.append(self.problem.layout.typical, no_bound)
        return held_out(self.residual, jacobian, self.noise, folds(self.table), theta, prior, reach, bounds)

    @cached_property
    def cross_validated_excess(self) -> float:
        """Excess by generalised cross-validation, in which no row weighs more than the others.

        The error on unseen rows is mostly that of the rows that alone determine a parameter, such as the few poses of
        a saturation. Source: Golub, Heath and Wahba, Technometrics 21 (1979) 215.
        """
        rows = self.residual.size
        return self.pooled_excess * rows / max(rows - self.effective_parameters, 1.0)

    @cached_property
    def effective_parameters(self) -> float:
        """The number of parameters that the rows determine; a parameter that its prior holds counts less than one."""
        return parameters_of_rows(self.whitened[:, 1:], self.problem.layout.prior)

    def share_left(self, start: Solution) -> float:
        """Part of the excess variance of `start` that this fit does not explain.

        Where it has priors by cross-validation, because a free form follows the rows of its fit; in motion, which has
        few rows, on unseen ones.
        """
        if self.table.type.moving:
            return max(self.held_out_excess**2 - 1, 0.0) / max(start.held_out_excess**2 - 1, 1e-9)
        if len(self.problem.layout.prior_rows):
            return max(self.cross_validated_excess**2 - 1, 0.0) / max(start.cross_validated_excess**2 - 1, 1e-9)
        return max(self.pooled_excess**2 - 1, 0.0) / max(start.pooled_excess**2 - 1, 1e-9)

    def in_floor(self, floor: Array) -> Self:
        """The solution with the noise floor (channels,) of another model, if only its residual measures its noise.

        All models of a search share one floor. With a floor of its own each, no two would be comparable: without what
        is smooth over the angles, a residual still holds what follows the time or a temperature.
        """
        return self if self.noise.known else replace(self, noise=replace(self.noise, reference=floor))

    def in_white_noise(self) -> Self:
        """The solution with the white noise of its rows as its floor, if that noise is known.

        Its slow noise contains the part that the next effect explains. A fit that begins in white noise depends only on
        the model and the data, not on the fits before it.
        """
        return self if self.problem.white is None else replace(self, noise=white_noise(self.problem))

    @property
    def free_jacobian(self) -> Array:
        """Columns of the parameters without a prior: a prior already keeps the others from following noise."""
        return self.jacobian[:, :, self.problem.layout.free]

    @cached_property
    def whitened(self) -> Array:
        """[residual, jacobian] made white, shape (channels * n, 1 + p)."""
        return self.noise.whiten(np.concatenate([self.residual[:, :, None], self.jacobian], axis=2))

    @property
    def information(self) -> Array:
        """Whitened jacobian, errors widened by the Birge ratio, and the priors below it, shape (rows, p)."""
        return np.vstack([self.whitened[:, 1:] / self.birge, self.problem.layout.prior_rows])

    @cached_property
    def birge(self) -> float:
        """Birge ratio: rms of the whitened residual, at least 1. Above 1, the model misses more than noise."""
        rows, p = self.residual.size, len(self.theta)
        return max(1.0, float(np.sqrt(np.sum(self.whitened[:, 0] ** 2) / max(rows - p, 1))))


def solution_at(problem: Problem, theta: Array, noise: Noise) -> Solution:
    """The residual and the jacobian at the parameters `theta` (p,)."""
    return Solution(problem, theta, noise, problem.residual(theta), problem.jacobian(theta))


def white_noise(problem: Problem) -> Noise:
    """The noise at the start of a fit: the stated white noise, and the slow noise of a still record."""
    return white_only(problem.white, problem.gap_s, len(problem.channels), problem.given)


def folds(table: Table) -> NDArray[np.intp]:
    """Fold number of each row, shape (n,); rows at the same angles share one, unless all rows do."""
    pose = pose_numbers(table)
    if pose is None or one_orientation(table):
        return np.random.default_rng(0).permutation(table.n) % min(table.n, MOST_FOLDS)
    poses = int(pose.max()) + 1
    number = np.random.default_rng(0).permutation(poses) % min(poses, FOLDS)
    return np.asarray(number[pose])


def pose_numbers(table: Table) -> NDArray[np.intp] | None:
    """The number of the pose at which each row was measured, (n,); None for tables without angles."""
    names = [name for name in table.type.same_pose if name in table]
    if not names:
        return None
    keys = np.column_stack([np.round(table.column(name), 6) for name in names])
    return np.asarray(np.unique(keys, axis=0, return_inverse=True)[1].ravel())


def repeats_few_poses(table: Table) -> bool:
    """Whether the rows are at few poses, each of which was visited many times."""
    pose = pose_numbers(table)
    return pose is not None and len(pose) >= FEWEST_VISITS * (int(pose.max()) + 1)


def held_out(
    residual: Array,
    jacobian: Array,
    noise: Noise,
    fold: NDArray[np.intp],
    theta: Array,
    prior: Array,
    reach: Array,
    bounds: tuple[Array, Array],
) -> float:
    """Pooled rms of the error on unseen rows over the noise floor.

    From residual (channels, n), jacobian (channels, n, p), the fold of each row (n,), the parameters (p,), the
    standard deviation of their priors (p,), inf where there is none, their typical magnitudes `reach` (p,) and their
    bounds. A parameter that the other rows determine badly, such as the loss of a saturation, keeps within its bounds,
    and changes by about its typical magnitude at most: an estimate that is less certain is not identified.
    """
    channels, n, p = jacobian.shape
    size = np.linalg.norm(jacobian.reshape(channels * n, p), axis=0)
    size = np.where(size > 0, size, 1.0)
    J = jacobian / size
    white = noise.whiten(np.concatenate([J, residual[:, :, None]], axis=2)).reshape(channels, n, p + 1)
    total = np.einsum("cni,cnj->ij", white, white)
    precision = 1 / (prior * size) ** 2
    weak = np.where(np.isfinite(prior), 0.0, 1 / (reach * size) ** 2)
    ridge = RIDGE * np.trace(total[:p, :p]) / max(p, 1) * np.eye(p) + np.diag(precision + weak)
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
