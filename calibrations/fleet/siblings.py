"""Partial pooling: the parameters of each sensor in a batch, estimated together with its siblings.

    theta_i ~ N(mu, diag(tau^2))        data of sensor i: theta_hat_i with information A_i (p, p)

Parameters vary independently over the batch, but the estimates of one sensor are correlated, strongly so with few
poses. One parameter is treated at a time: the others of each sensor are integrated over their batch distribution, which
gives y_i and v_i for `fit_siblings`. This repeats until the spreads converge. A parameter that a sensor's poses do not
determine gets the batch's prediction.

For one parameter, `fit_siblings` estimates the mean and the spread in the batch, and the value of each sensor:

    y_i ~ N(theta_i, v_i)        theta_i ~ N(mu, tau^2)        flat in mu and in tau

The posterior is exact except for a sum over a grid of tau: for a given tau all is normal, and the weight of each tau
follows from the data. So the intervals include the uncertainty of mu and tau, also for a batch of few or equal
sensors (tau near 0), where an estimate of tau alone gives too short intervals. An outlier is separated: it changes
no sibling, and no sibling changes it.

If sensors differ by much more than the uncertainty of a fit (tau >> std), pooling changes nothing.

Source  Gelman et al., Bayesian Data Analysis (3rd ed.), 5.4-5.5, (5.20)-(5.21); Efron and Morris (1975).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, stdtr

from calibrations.criteria import FALSE_OUTLIER, FEWEST_SIBLINGS, MOST_USUAL
from calibrations.means.noise import robust_std
from calibrations.table import Array

GRID = 80
HALVINGS = 40


@dataclass(frozen=True)
class Siblings:
    """The posterior. `y` and their variances `v`, (n,); `outliers` (n,) are not pooled; `tau` a grid with weights that
    add up to 1. With fewer than FEWEST that are alike nothing is pooled."""

    y: Array
    v: Array
    outliers: NDArray[np.bool_]
    tau: Array
    weight: Array

    @property
    def pooled(self) -> bool:
        """Whether there are enough sensors to pool."""
        return int(np.sum(~self.outliers)) >= FEWEST_SIBLINGS

    @cached_property
    def _means(self) -> tuple[Array, Array]:
        """mu and its variance given each tau, (grid,)."""
        return _means(self.y[~self.outliers], self.v[~self.outliers], self.tau)

    @property
    def mean(self) -> float:
        """The mean of mu."""
        return float(self.weight @ self._means[0])

    @property
    def mean_std(self) -> float:
        """Standard uncertainty of mu."""
        mu, variance = self._means
        return float(np.sqrt(self.weight @ (variance + (mu - self.mean) ** 2)))

    @property
    def spread(self) -> float:
        """The median of tau."""
        return float(self.spread_interval(0.5)[0])

    def spread_interval(self, *shares: float) -> Array:
        """Quantiles of tau."""
        return np.interp(shares, np.cumsum(self.weight) - self.weight / 2, self.tau)

    @property
    def variance(self) -> float:
        """The mean of tau^2."""
        return float(self.weight @ self.tau**2)

    @cached_property
    def _estimate_each(self) -> tuple[Array, Array]:
        """Mean and standard deviation of every theta given each tau, (grid, n)."""
        mu, variance = (value[:, None] for value in self._means)
        share = self.v / (self.v + self.tau[:, None] ** 2)
        share = np.where(self.outliers | (not self.pooled), 0.0, share)
        return self.y - share * (self.y - mu), np.sqrt(self.v * (1 - share) + share**2 * variance)

    @cached_property
    def values(self) -> Array:
        """The mean of every theta, (n,)."""
        return np.asarray(self.weight @ self._estimate_each[0])

    @cached_property
    def stds(self) -> Array:
        """Standard deviations of every theta, (n,)."""
        mean, std = self._estimate_each
        return np.asarray(np.sqrt(self.weight @ (std**2 + (mean - self.values) ** 2)))

    def interval(self, coverage: float = 0.95) -> tuple[Array, Array]:
        """The central interval of every theta."""
        return self._quantile((1 - coverage) / 2), self._quantile((1 + coverage) / 2)

    def _quantile(self, share: float) -> Array:
        """The quantile of every theta in its mixture over tau, by bisection."""
        mean, std = self._estimate_each
        low, high = np.min(mean - 12 * std, axis=0), np.max(mean + 12 * std, axis=0)
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            too_low = self.weight @ ndtr((middle - mean) / std) < share
            low, high = np.where(too_low, middle, low), np.where(too_low, high, middle)
        return np.asarray((low + high) / 2)


def fit_siblings(y: Array, v: Array) -> Siblings:
    """The posterior of values `y` with variances `v`, (n,), those that are unlike all others set apart."""
    is_unlike = _suspects(y, v)
    if is_unlike.any():
        siblings = _posterior(y, v, is_unlike)
        variance = siblings.variance + siblings.mean_std**2 + v
        off = np.abs(y - siblings.mean) / np.sqrt(variance)
        freedom = max(int(np.sum(~is_unlike)) - 1, 1)
        is_unlike &= 2 * stdtr(freedom, -off) * len(y) < FALSE_OUTLIER
    return _posterior(y, v, is_unlike)


def _suspects(y: Array, v: Array) -> NDArray[np.bool_]:
    """Values far from the median; none where fewer than FEWEST would be left."""
    middle = float(np.median(y))
    spread = float(robust_std(y - middle))
    suspects = np.abs(y - middle) > MOST_USUAL * np.sqrt(spread**2 + v)
    return suspects if int(np.sum(~suspects)) >= FEWEST_SIBLINGS else np.zeros(len(y), dtype=bool)


def _posterior(y: Array, v: Array, is_unlike: NDArray[np.bool_]) -> Siblings:
    usual, noise = y[~is_unlike], v[~is_unlike]
    if len(usual) < FEWEST_SIBLINGS:
        return Siblings(y, v, is_unlike, np.zeros(1), np.ones(1))
    grid = (np.arange(GRID) + 0.5) / GRID
    scale = float(np.std(usual)) + np.sqrt(float(np.median(noise))) / 4
    tau = scale * grid / (1 - grid)
    mu, variance = _means(usual, noise, tau)
    total = noise + tau[:, None] ** 2
    log = -0.5 * np.sum(np.log(total) + (usual - mu[:, None]) ** 2 / total, axis=1) + 0.5 * np.log(variance)
    log -= 2 * np.log1p(-grid)  # the grid's spacing, which makes the density flat in tau
    weight = np.exp(log - log.max())
    return Siblings(y, v, is_unlike, tau, weight / weight.sum())


def _means(y: Array, v: Array, tau: Array) -> tuple[Array, Array]:
    """The mean of all given each tau, and its variance: (grid,)."""
    weight = 1 / (v + tau[:, None] ** 2)
    total = weight.sum(axis=1)
    return np.asarray(weight @ y / total), np.asarray(1 / total)


SWEEPS = 6
CONVERGENCE = 0.01  # relative change of the spreads
NOTHING = 1e-10  # information, in typical sizes, of a parameter that nothing is known of
WIDE = 1e4  # spread, in typical sizes, before anything is known


@dataclass(frozen=True)
class PooledParameters:
    """For each parameter its siblings; `scale` (p,) is what their values are given in.

    `alone` (n, p): standard uncertainties without siblings; inf if the sensor's own data do not determine them.
    """

    parameters: tuple[Siblings, ...]
    scale: Array
    alone: Array

    @property
    def values(self) -> Array:
        """(n, p)."""
        return np.column_stack([parameter.values for parameter in self.parameters]) * self.scale

    @property
    def stds(self) -> Array:
        """(n, p)."""
        return np.column_stack([parameter.stds for parameter in self.parameters]) * self.scale

    def intervals(self, coverage: float = 0.95) -> tuple[Array, Array]:
        """Lowest and highest values, (n, p) each."""
        ends = np.array([parameter.interval(coverage) for parameter in self.parameters])  # (p, 2, n)
        return np.asarray(ends[:, 0].T * self.scale), np.asarray(ends[:, 1].T * self.scale)

    @property
    def outliers(self) -> Array:
        """(n, p): whether a sensor's parameter is unlike those of all siblings."""
        return np.column_stack([parameter.outliers for parameter in self.parameters])


def pool_siblings(theta: Array, information: Array, typical: Array) -> PooledParameters:
    """Pool estimates `theta` (n, p) with `information` (n, p, p); `typical` (p,) magnitudes."""
    scaled = information * np.outer(typical, typical) + NOTHING * np.eye(len(typical))
    weighted = np.einsum("nij,nj->ni", scaled, theta / typical)
    prior, mean = np.full(theta.shape, WIDE**-2.0), np.zeros(theta.shape)
    siblings: list[Siblings] = []
    for _ in range(SWEEPS):
        previous = prior.copy()
        siblings = []
        for k in range(theta.shape[1]):
            siblings.append(fit_siblings(*_estimate_alone(scaled, weighted, prior, mean, k)))
            mean[:, k], prior[:, k] = _prior(siblings[-1])
        if np.all(np.abs(prior / previous - 1) < CONVERGENCE):
            break
    own_covariance = np.linalg.inv(scaled)
    std = np.sqrt(np.diagonal(own_covariance, axis1=1, axis2=2))
    return PooledParameters(tuple(siblings), typical, np.where(std < WIDE, std, np.inf) * typical)


def _estimate_alone(scaled: Array, weighted: Array, prior: Array, mean: Array, k: int) -> tuple[Array, Array]:
    """Parameter k and its variance for each sensor, (n,), by its own data and the prior of its other parameters."""
    prior_of_others = prior.copy()
    prior_of_others[:, k] = 0.0
    total = scaled + prior_of_others[:, :, None] * np.eye(scaled.shape[1])
    inverse = np.linalg.inv(total)[:, k]
    return np.einsum("nj,nj->n", inverse, weighted + prior_of_others * mean), np.asarray(inverse[:, k])


def _prior(siblings: Siblings) -> tuple[Array | float, Array | float]:
    """Prior of each sensor from its batch: mean and inverse variance; none for outliers."""
    if not siblings.pooled:
        return 0.0, WIDE**-2.0
    precision = 1 / (siblings.variance + siblings.mean_std**2)
    return np.where(siblings.outliers, 0.0, siblings.mean), np.where(siblings.outliers, WIDE**-2.0, precision)
