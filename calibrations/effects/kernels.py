"""Compiled loops over rows, where each depends on the one before. Cached on disk by `make setup`.

All compiled loops of this house let other threads go on (nogil): a page stays alive while effects are tried.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from calibrations.table import Array


@njit(cache=True, nogil=True)
def _follow(forces: Array, previous: float, points: Array, present: float, limits: Array, limit_factor: float) -> float:
    """Move all elements from the force `previous` over `points` to `present`, each as far as its limit; `present`."""
    for j in range(len(points) + 1):
        point = points[j] if j < len(points) else present
        for e in range(len(limits)):
            limit = limits[e] * limit_factor
            forces[e] = min(limit, max(-limit, forces[e] + point - previous))
        previous = point
    return present


@njit(cache=True, nogil=True)
def slip_elements(a: Array, on_the_way: Array, limit_factors: Array, limits: Array, first_shares: Array) -> Array:
    """Force held by elements of equal stiffness that stick and slip, at each row, shape (n, elements, 3), g.

    a              (n, 3) specific force, g
    on_the_way     (n, turns, 3) points where it turned round before each row
    limit_factors  (n, 3) factor on the limits
    limits         (elements,) g; an element follows the force and slips at its limit; rows in order of time
    first_shares   (3,) share of its limit that each element holds before the first row, from -1 to 1
    """
    n, axes = a.shape
    state = np.zeros((n, len(limits), axes))
    for k in range(axes):
        forces = first_shares[k] * limits
        previous = 0.0
        for i in range(n):
            previous = _follow(forces, previous, on_the_way[i, :, k], a[i, k], limits, limit_factors[i, k])
            state[i, :, k] = forces
    return state


@njit(cache=True, nogil=True)
def slip(a: Array, on_the_way: Array, limit_factors: Array, limits: Array, first_shares: Array) -> Array:
    """Force held by all elements of `slip_elements`, shape (n, 3), 1 where all slip; limits (elements, 3)."""
    n, axes = a.shape
    shares = np.empty((n, axes))
    for k in range(axes):
        limits_of_axis = np.ascontiguousarray(limits[:, k])
        total = limits_of_axis.sum()
        forces = first_shares[k] * limits_of_axis
        previous = 0.0
        for i in range(n):
            previous = _follow(forces, previous, on_the_way[i, :, k], a[i, k], limits_of_axis, limit_factors[i, k])
            total_force = forces[0]
            for e in range(1, len(forces)):
                total_force += forces[e]
            shares[i, k] = total_force / total
    return shares


@njit(cache=True, nogil=True)
def play(values: Array, width: float) -> Array:
    """The output of a play of `width` to either side for `values` (n,), rows in order of time, shape (n,)."""
    follower = values[0]
    lagging = np.empty_like(values)
    for i in range(len(values)):
        follower = min(max(follower, values[i] - width), values[i] + width)
        lagging[i] = follower
    return lagging
