"""The solution of a least-squares problem under given noise, and the figures that follow from it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from calibrations.fitting.held_out import folds, held_out, parameters_of_rows
from calibrations.fitting.problem import Problem
from calibrations.means.noise import Noise, rms, white_only
from calibrations.table import Array, Table


@dataclass(frozen=True, eq=False)
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
        """Pooled rms of the error on unseen rows over the noise floor."""
        return self.held_out_with(np.zeros((*self.residual.shape, 0)))

    def held_out_with(self, extra: Array) -> float:
        """The same when columns (channels, n, k) join the fit."""
        jacobian = np.concatenate([self.jacobian, extra], axis=2)
        theta = np.append(self.theta, np.zeros(extra.shape[2]))
        no_bound = np.full(extra.shape[2], np.inf)
        low, high = self.problem.layout.bounds
        bounds = np.append(low, -no_bound), np.append(high, no_bound)
        prior = np.append(self.problem.layout.prior, no_bound)
        return held_out(self.residual, jacobian, self.noise, folds(self.table), theta, prior, bounds)

    @cached_property
    def cross_validated_excess(self) -> float:
        """Excess by generalised cross-validation, in which no row weighs more than the others.

        The error on unseen rows is mostly that of the rows that alone determine a parameter, such as the few poses of
        a saturation. Source: Golub, Heath and Wahba, Technometrics 21 (1979) 215.
        """
        rows = self.residual.size
        parameters = parameters_of_rows(self.whitened[:, 1:], self.problem.layout.prior)
        return self.pooled_excess * rows / max(rows - parameters, 1.0)

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

    @property
    def residual_is_noise(self) -> bool:
        """Whether the residual itself is the only measure of noise: neither samples nor smooth columns give one."""
        return not self.noise.known and not self.problem.smooth.size

    def in_floor(self, floor: Array) -> Self:
        """The same with the noise floor (channels,) of another model, if its own is its residual.

        All models of a search share one floor. With a floor of its own each, no two would be comparable.
        """
        return replace(self, noise=replace(self.noise, reference=floor)) if self.residual_is_noise else self

    def in_white_noise(self) -> Self:
        """The same in the white noise of its rows, if that is known.

        Its slow noise contains what the next effect explains. And a fit that begins in white noise depends on the model
        and the data alone, not on the fits before it.
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
    """The noise of a problem before any is estimated: white, and what is known of slow noise."""
    return white_only(problem.white, problem.gap_s, len(problem.channels), problem.given)
