"""Compiled loops over rows, where each depends on the one before. Cached on disk by `make setup`."""

from __future__ import annotations

import numpy as np
from numba import njit

from calibrations.table import Array


@njit(cache=True)
def slip(a: Array, before: Array, limit: Array, reach: float) -> Array:
    """State of an element that sticks and slips at +-limit, at each row, shape (n, 3); rows in order of time.

    Each row is reached by way of `before`, the specific force a little earlier.
    """
    state = np.zeros_like(a)
    for k in range(a.shape[1]):
        s = 0.0
        last = before[0, k]
        for i in range(a.shape[0]):
            s = min(limit[i, k], max(-limit[i, k], s + (before[i, k] - last) / reach))
            s = min(limit[i, k], max(-limit[i, k], s + (a[i, k] - before[i, k]) / reach))
            last = a[i, k]
            state[i, k] = s
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
