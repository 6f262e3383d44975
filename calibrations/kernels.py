"""Compiled loops over rows, where each depends on the one before. Cached on disk by `make setup`."""

from __future__ import annotations

import numpy as np
from numba import njit

from calibrations.table import Array


@njit(cache=True)
def slip(a: Array, on_the_way: Array, pressed: Array, limits: Array) -> Array:
    """Force held by elements of equal stiffness that stick and slip, at each row, shape (n, 3), 1 where all slip.

    a            (n, 3) specific force, g
    on_the_way   (n, turns, 3) points where it turned round before each row
    pressed      (n, 3) factor on the limits
    limits       (elements,) g; an element follows the force and slips at its limit; rows in order of time
    """
    n, axes = a.shape
    state = np.zeros_like(a)
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
            state[i, k] = np.sum(held) / np.sum(limits)
    return state


@njit(cache=True)
def whiten(columns: Array, gap_s: Array, white: Array, slow: float, tau_s: float) -> tuple[Array, float]:
    """Columns made white under white noise plus a Gauss-Markov process, and the log-determinant.

    A Kalman filter's innovations over their standard deviation: exact, and linear in the number of rows.

    columns  (n, k), rows in order of time
    gap_s    (n,) time since the row before
    white    (n,) standard deviation of the white noise of each row
    slow     standard deviation of the Gauss-Markov process, tau_s its time constant
    """
    n, k = columns.shape
    out = np.empty_like(columns)
    state = np.zeros(k)
    variance = slow * slow
    logdet = 0.0
    for i in range(n):
        phi = np.exp(-gap_s[i] / tau_s) if i else 0.0
        variance = phi * phi * variance + slow * slow * (1.0 - phi * phi)
        total = variance + white[i] * white[i]
        gain = variance / total
        scale = 1.0 / np.sqrt(total)
        for j in range(k):
            predicted = phi * state[j]
            innovation = columns[i, j] - predicted
            out[i, j] = innovation * scale
            state[j] = predicted + gain * innovation
        variance *= 1.0 - gain
        logdet += np.log(total)
    return out, logdet
