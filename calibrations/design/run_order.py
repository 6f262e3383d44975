"""The order of poses: short moves, and no parameter that a drift in time can imitate.

Both count in seconds of rig time. Moves cost their duration. An unknown drift, a parabola in time on each output, takes
information from parameters that changed with time; it costs the dwell that would restore the worst parameter.

The nearest-neighbour order is improved by reversing stretches and by moving poses, with a slowly falling chance to
accept a worse order (simulated annealing).

Source  Tack and Vandebroek, J. Statistical Planning and Inference 98 (2001), 293-310, on orders that resist a trend at
        low cost; Lin and Kernighan, Operations Research 21 (1973), 498-516, on exchanges along a way.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calibrations.fitting.identifiability import RELATIVE_RANK
from calibrations.table import Array

PROPOSALS = 250  # for each pose
WARM_S, COLD_S = 10.0, 0.05  # rig time that is given away for a better order later: at the beginning, at the end
DEGREES = (1, 2)  # of time: the forms that a drift may have
Order = NDArray[np.intp]


@dataclass(frozen=True)
class Tour:
    """Poses to be ordered.

    start_s   from the present position of the stages to each pose, shape (n,)
    move_s    from pose to pose, shape (n, n), not the same both ways
    rows      their information, shape (n, axes, p), white; 0 for a pose that no fit sees
    dwell_s   of all poses together
    """

    start_s: Array
    move_s: Array
    rows: Array
    dwell_s: float

    def cost_s(self, order: Order) -> float:
        """Time of the moves, and of the additional dwell that compensates a drift, s."""
        return self.travel_s(order) + self.dwell_s * self.drift_loss(order)

    def travel_s(self, order: Order) -> float:
        """Time of all moves."""
        return float(self.start_s[order[0]] + self.move_s[order[:-1], order[1:]].sum())

    def drift_loss(self, order: Order) -> float:
        """Largest growth of a parameter's variance when a drift is fitted too.

        Relative: 0 if no order of time is in the poses' order.
        """
        axes, p = self.rows.shape[1:]
        drift_part = (self._trend.T @ self._basis_rows[order]).reshape(len(DEGREES) * axes, p)
        remaining = np.eye(len(drift_part)) - drift_part @ drift_part.T
        if np.linalg.eigvalsh(remaining)[0] < RELATIVE_RANK:
            return float("inf")
        spread = drift_part @ self._root.T
        return float(np.max(np.sum(spread * np.linalg.solve(remaining, spread), axis=0) / self._variance))

    @cached_property
    def _root(self) -> Array:
        """R (p, p) with R R' the covariance without a drift, in units in which each parameter's rows have length 1."""
        _, s, Vt = np.linalg.svd(self._flat, full_matrices=False)
        determined = s > RELATIVE_RANK * s[0]
        return np.asarray(Vt.T * np.where(determined, 1 / np.where(determined, s, 1.0), 0.0))

    @cached_property
    def _flat(self) -> Array:
        flat = self.rows.reshape(-1, self.rows.shape[2])
        size = np.linalg.norm(flat, axis=0)
        return np.asarray(flat / np.where(size > 0, size, 1.0))

    @cached_property
    def _basis_rows(self) -> Array:
        """Rows of an orthonormal basis, (n, axes * p)."""
        return np.asarray((self._flat @ self._root).reshape(len(self.rows), -1))

    @cached_property
    def _variance(self) -> Array:
        variance = np.sum(self._root**2, axis=1)
        return np.where(variance > 0, variance, np.inf)

    @cached_property
    def _trend(self) -> Array:
        """Orthonormal polynomials over the places of an order at equal distances, (n, degrees)."""
        u = np.linspace(-1.0, 1.0, len(self.rows))
        return np.asarray(np.linalg.qr(np.vander(u, max(DEGREES) + 1, increasing=True))[0][:, list(DEGREES)])


def order_tour(tour: Tour) -> Order:
    """An order of low cost, shape (n,). The same tour gives the same order."""
    rng = np.random.default_rng(0)
    present = best = _nearest_neighbours(tour)
    cost = least = tour.cost_s(present)
    for warmth_s in np.geomspace(WARM_S, COLD_S, PROPOSALS * len(present)):
        trial_order, most = _neighbour_order(present, rng), cost + warmth_s * rng.exponential()
        if tour.travel_s(trial_order) < most and (tried_cost := tour.cost_s(trial_order)) < most:
            present, cost = trial_order, tried_cost
            if cost < least:
                best, least = present, cost
    return best


def _nearest_neighbours(tour: Tour) -> Order:
    order = [int(np.argmin(tour.start_s))]
    remaining = set(range(len(tour.start_s))) - set(order)
    while remaining:
        order.append(min(remaining, key=lambda k: (tour.move_s[order[-1], k], k)))
        remaining.remove(order[-1])
    return np.array(order, dtype=np.intp)


def _neighbour_order(order: Order, rng: np.random.Generator) -> Order:
    """A part of the order reversed, or moved to another place."""
    i, j = np.sort(rng.integers(0, len(order) + 1, 2))
    if rng.random() < 0.5:
        return np.concatenate([order[:i], order[i:j][::-1], order[j:]])
    remaining = np.concatenate([order[:i], order[j:]])
    k = rng.integers(0, len(remaining) + 1)
    return np.concatenate([remaining[:k], order[i:j], remaining[k:]])
