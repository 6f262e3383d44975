"""The compiled filter that makes columns white, and its transpose. They let other threads go on (nogil)."""

from __future__ import annotations

import numpy as np
from numba import njit

from calibrations.table import Array


@njit(cache=True, nogil=True)
def whiten(columns: Array, gap_s: Array, white: Array, slow: Array, tau_s: Array) -> tuple[Array, float]:
    """Columns made white under white noise plus Gauss-Markov processes, and the log-determinant.

    A Kalman filter's innovations over their standard deviation: exact, and linear in the number of rows.

    columns  (n, k), rows in order of time
    gap_s    (n,) time since the row before
    white    (n,) standard deviation of the white noise of each row
    slow     (m,) standard deviations of the processes, tau_s (m,) their time constants
    """
    n, k = columns.shape
    m = len(slow)
    whitened = np.empty_like(columns)
    state = np.zeros((m, k))
    P = np.diag(slow * slow)
    gain, phi = np.zeros(m), np.zeros(m)
    logdet = 0.0
    for i in range(n):
        if i:
            if i == 1 or gap_s[i] != gap_s[i - 1]:
                for p in range(m):
                    phi[p] = np.exp(-gap_s[i] / tau_s[p])
            for p in range(m):
                for q in range(m):
                    P[p, q] *= phi[p] * phi[q]
                P[p, p] += slow[p] * slow[p] * (1.0 - phi[p] * phi[p])
                for j in range(k):
                    state[p, j] *= phi[p]
        total = white[i] * white[i]
        for p in range(m):
            gain[p] = 0.0
            for q in range(m):
                gain[p] += P[p, q]
            total += gain[p]
        scale = 1.0 / np.sqrt(total)
        row = whitened[i]  # row by row, so that a step goes over all columns at once
        row[:] = columns[i]
        for p in range(m):
            for j in range(k):
                row[j] -= state[p, j]
        for p in range(m):
            share = gain[p] / total
            for j in range(k):
                state[p, j] += share * row[j]
        for j in range(k):
            row[j] *= scale
        for p in range(m):
            for q in range(m):
                P[p, q] -= gain[p] * gain[q] / total
        logdet += np.log(total)
    return whitened, logdet


@njit(cache=True, nogil=True)
def whiten_transposed(columns: Array, gap_s: Array, white: Array, slow: Array, tau_s: Array) -> Array:
    """W^T times columns (n, k), where W is the matrix by which `whiten` multiplies; arguments as there.

    The same filter with its steps in reverse order, so that W (n, n) is not made.
    """
    n, k = columns.shape
    m = len(slow)
    gains, phis, scales = np.zeros((n, m)), np.zeros((n, m)), np.zeros(n)
    P = np.diag(slow * slow)
    for i in range(n):
        if i:
            for p in range(m):
                phis[i, p] = np.exp(-gap_s[i] / tau_s[p])
            for p in range(m):
                for q in range(m):
                    P[p, q] *= phis[i, p] * phis[i, q]
                P[p, p] += slow[p] * slow[p] * (1.0 - phis[i, p] * phis[i, p])
        gain = P.sum(axis=1)
        total = white[i] * white[i] + gain.sum()
        scales[i] = 1.0 / np.sqrt(total)
        for p in range(m):
            gains[i, p] = gain[p] / total
            for q in range(m):
                P[p, q] -= gain[p] * gain[q] / total
    transposed = np.empty_like(columns)
    later = np.zeros((m, k))  # the part of the state from later rows
    for i in range(n - 1, -1, -1):
        for j in range(k):
            transposed[i, j] = columns[i, j] * scales[i]
            for p in range(m):
                transposed[i, j] += gains[i, p] * later[p, j]
            for p in range(m):
                later[p, j] = phis[i, p] * (later[p, j] - transposed[i, j])
    return transposed
