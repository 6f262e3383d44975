"""One quantity of many siblings: its mean and spread in the batch, and what each one's own value is in their light.

    y_i ~ N(theta_i, v_i)        theta_i ~ N(mu, tau^2)        flat in mu and in tau

The posterior is exact but for a sum over a grid of tau: given tau, all is normal, and the weight of each tau follows
from the data. So intervals hold what mu and tau are uncertain by, also in a batch of a few sensors or of equal ones
(tau near 0), where an estimate of tau put in its place would make them too short. A value that is unlike all others is
set apart: it neither moves its siblings nor is moved by them.

Source  Gelman et al., Bayesian Data Analysis (3rd ed.), 5.4-5.5, (5.20)-(5.21); Efron and Morris (1975).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, stdtr

from calibrations.table import Array

FEWEST = 3  # siblings that tell a spread: with fewer the posterior of tau is none
GRID = 80
HALVINGS = 40
APART = 0.01  # chance of setting any value of a batch apart where all are alike
SUSPECT = 3.0  # robust standard deviations off the median: looked at again without each other
TO_STD = 1.4826  # median of absolute deviations to standard deviation


@dataclass(frozen=True)
class Siblings:
    """The posterior. `y` and their variances `v`, (n,); `apart` (n,) are not pooled; `tau` a grid with weights that add
    up to 1. With fewer than FEWEST that are alike nothing is pooled."""

    y: Array
    v: Array
    apart: NDArray[np.bool_]
    tau: Array
    weight: Array

    @property
    def pooled(self) -> bool:
        """Whether there are enough to learn from."""
        return int(np.sum(~self.apart)) >= FEWEST

    @cached_property
    def _means(self) -> tuple[Array, Array]:
        """mu and its variance given each tau, (grid,)."""
        return _means(self.y[~self.apart], self.v[~self.apart], self.tau)

    @property
    def mean(self) -> float:
        """Of mu."""
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
    def _each(self) -> tuple[Array, Array]:
        """Mean and standard deviation of every theta given each tau, (grid, n)."""
        mu, variance = (value[:, None] for value in self._means)
        share = self.v / (self.v + self.tau[:, None] ** 2)
        share = np.where(self.apart | (not self.pooled), 0.0, share)
        return self.y - share * (self.y - mu), np.sqrt(self.v * (1 - share) + share**2 * variance)

    @cached_property
    def values(self) -> Array:
        """The mean of every theta, (n,)."""
        return np.asarray(self.weight @ self._each[0])

    @cached_property
    def stds(self) -> Array:
        """Standard deviations of every theta, (n,)."""
        mean, std = self._each
        return np.asarray(np.sqrt(self.weight @ (std**2 + (mean - self.values) ** 2)))

    def interval(self, coverage: float = 0.95) -> tuple[Array, Array]:
        """The central interval of every theta."""
        return self._quantile((1 - coverage) / 2), self._quantile((1 + coverage) / 2)

    def _quantile(self, share: float) -> Array:
        """Of the mixture over tau, by halving."""
        mean, std = self._each
        low, high = np.min(mean - 12 * std, axis=0), np.max(mean + 12 * std, axis=0)
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            below = self.weight @ ndtr((middle - mean) / std) < share
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        return np.asarray((low + high) / 2)


def siblings(y: Array, v: Array) -> Siblings:
    """The posterior of values `y` with variances `v`, (n,), those that are unlike all others set apart."""
    apart = _suspects(y, v)
    if apart.any():
        alike = _posterior(y, v, apart)
        variance = alike.variance + alike.mean_std**2 + v
        off = np.abs(y - alike.mean) / np.sqrt(variance)
        freedom = max(int(np.sum(~apart)) - 1, 1)
        apart &= 2 * stdtr(freedom, -off) * len(y) < APART
    return _posterior(y, v, apart)


def _suspects(y: Array, v: Array) -> NDArray[np.bool_]:
    """Values far from the median; none where fewer than FEWEST would be left."""
    middle = float(np.median(y))
    spread = TO_STD * float(np.median(np.abs(y - middle)))
    out = np.abs(y - middle) > SUSPECT * np.sqrt(spread**2 + v)
    return out if int(np.sum(~out)) >= FEWEST else np.zeros(len(y), dtype=bool)


def _posterior(y: Array, v: Array, apart: NDArray[np.bool_]) -> Siblings:
    own, noise = y[~apart], v[~apart]
    if len(own) < FEWEST:
        return Siblings(y, v, apart, np.zeros(1), np.ones(1))
    at = (np.arange(GRID) + 0.5) / GRID
    scale = float(np.std(own)) + np.sqrt(float(np.median(noise))) / 4
    tau = scale * at / (1 - at)
    mu, variance = _means(own, noise, tau)
    total = noise + tau[:, None] ** 2
    log = -0.5 * np.sum(np.log(total) + (own - mu[:, None]) ** 2 / total, axis=1) + 0.5 * np.log(variance)
    log -= 2 * np.log1p(-at)  # the grid's spacing, which makes the density flat in tau
    weight = np.exp(log - log.max())
    return Siblings(y, v, apart, tau, weight / weight.sum())


def _means(y: Array, v: Array, tau: Array) -> tuple[Array, Array]:
    """The mean of all given each tau, and its variance: (grid,)."""
    weight = 1 / (v + tau[:, None] ** 2)
    total = weight.sum(axis=1)
    return np.asarray(weight @ y / total), np.asarray(1 / total)
