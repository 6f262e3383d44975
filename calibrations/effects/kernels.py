"""Compiled loops over rows, where each depends on the one before. Cached on disk by `make setup`.

All compiled loops of this house let other threads go on (nogil): a page stays alive while effects are tried.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from calibrations.table import Array


@njit(cache=True, nogil=True)
def slip_elements(a: Array, on_the_way: Array, pressed: Array, limits: Array) -> Array:
    """Force held by elements of equal stiffness that stick and slip, at each row, shape (n, elements, 3), g.

    a            (n, 3) specific force, g
    on_the_way   (n, turns, 3) points where it turned round before each row
    pressed      (n, 3) factor on the limits
    limits       (elements,) g; an element follows the force and slips at its limit; rows in order of time
    """
    n, axes = a.shape
    state = np.zeros((n, len(limits), axes))
    for k in range(axes):
        held = np.zeros(len(limits))
        last = 0.0
        for i in range(n):
            for j in range(on_the_way.shape[1] + 1):
                here = on_the_way[i, j, k] if j < on_the_way.shape[1] else a[i, k]
                for e in range(len(limits)):
                    limit = limits[e] * pressed[i, k]
                    held[e] = min(limit, max(-limit, held[e] + here - last))
                last = here
            state[i, :, k] = held
    return state


def slip(a: Array, on_the_way: Array, pressed: Array, limits: Array) -> Array:
    """Force held by all elements, shape (n, 3), 1 where all slip."""
    return np.asarray(slip_elements(a, on_the_way, pressed, limits).sum(axis=1) / limits.sum())


@njit(cache=True, nogil=True)
def play(values: Array, width: float) -> Array:
    """What follows `values` (n,) behind a play of `width` to either side, rows in order of time, shape (n,)."""
    held = values[0]
    lagging = np.empty_like(values)
    for i in range(len(values)):
        held = min(max(held, values[i] - width), values[i] + width)
        lagging[i] = held
    return lagging
