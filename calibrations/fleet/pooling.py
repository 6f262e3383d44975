"""Partial pooling: the parameters of a batch's sensors, each in the light of its siblings.

    theta_i ~ N(mu, diag(tau^2))        what is known of sensor i: theta_hat_i with information A_i (p, p)

Parameters vary independently of each other over the batch; what one sensor knows of them is correlated, and with few
poses strongly so. One parameter at a time, the others of each sensor are integrated over what the batch says of them,
which leaves y_i and v_i for `siblings`. This is repeated until the spreads stand. A parameter that a sensor's poses do
not determine at all is then known as well as its siblings foretell it.

Where sensors differ by much more than a fit is uncertain by (tau >> std), nothing is gained, and nothing is lost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.fleet.siblings import Siblings, siblings
from calibrations.table import Array

SWEEPS = 6
SETTLED = 0.01  # relative change of the spreads
NOTHING = 1e-10  # information, in typical sizes, of a parameter that nothing is known of
WIDE = 1e4  # spread, in typical sizes, before anything is known


@dataclass(frozen=True)
class Pooled:
    """For each parameter its siblings; `scale` (p,) is what their values are given in.

    `alone` (n, p): standard uncertainties without siblings; inf where the sensor's own data do not tell.
    """

    parameters: tuple[Siblings, ...]
    scale: Array
    alone: Array

    @property
    def values(self) -> Array:
        """(n, p)."""
        return np.column_stack([each.values for each in self.parameters]) * self.scale

    @property
    def stds(self) -> Array:
        """(n, p)."""
        return np.column_stack([each.stds for each in self.parameters]) * self.scale

    def intervals(self, coverage: float = 0.95) -> tuple[Array, Array]:
        """Lowest and highest values, (n, p) each."""
        ends = np.array([each.interval(coverage) for each in self.parameters])  # (p, 2, n)
        return np.asarray(ends[:, 0].T * self.scale), np.asarray(ends[:, 1].T * self.scale)

    @property
    def apart(self) -> Array:
        """(n, p): whether a sensor's parameter is unlike those of all siblings, and stands alone."""
        return np.column_stack([each.apart for each in self.parameters])


def pooled(theta: Array, information: Array, typical: Array) -> Pooled:
    """Pool estimates `theta` (n, p) with `information` (n, p, p); `typical` (p,) magnitudes."""
    known = information * np.outer(typical, typical) + NOTHING * np.eye(len(typical))
    said = np.einsum("nij,nj->ni", known, theta / typical)
    prior, mean = np.full(theta.shape, WIDE**-2.0), np.zeros(theta.shape)
    found: list[Siblings] = []
    for _ in range(SWEEPS):
        before = prior.copy()
        found = []
        for k in range(theta.shape[1]):
            found.append(siblings(*_alone(known, said, prior, mean, k)))
            mean[:, k], prior[:, k] = _foretold(found[-1])
        if np.all(np.abs(prior / before - 1) < SETTLED):
            break
    own = np.linalg.inv(known)
    std = np.sqrt(np.diagonal(own, axis1=1, axis2=2))
    return Pooled(tuple(found), typical, np.where(std < WIDE, std, np.inf) * typical)


def _alone(known: Array, said: Array, prior: Array, mean: Array, k: int) -> tuple[Array, Array]:
    """Parameter k and its variance for each sensor, (n,), by its own data and what is foretold of its other ones."""
    others = prior.copy()
    others[:, k] = 0.0
    total = known + others[:, :, None] * np.eye(known.shape[1])
    inverse = np.linalg.inv(total)[:, k]
    return np.einsum("nj,nj->n", inverse, said + others * mean), np.asarray(inverse[:, k])


def _foretold(found: Siblings) -> tuple[Array | float, Array | float]:
    """What the batch says of each sensor before its own data: mean and inverse variance; nothing of those apart."""
    if not found.pooled:
        return 0.0, WIDE**-2.0
    precision = 1 / (found.variance + found.mean_std**2)
    return np.where(found.apart, 0.0, found.mean), np.where(found.apart, WIDE**-2.0, precision)
