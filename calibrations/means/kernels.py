"""Compiled loops over noises of means: the filter that makes columns white, and the levels of noise on a grid.

Matrices have a few columns each, and calls would cost more than the sums. The loops let other threads go on (nogil).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calibrations.table import Array

LEVEL_ROUNDS = 3  # in which levels settle
RIDGE = 1e-13  # of each diagonal element
TINY = np.finfo(np.float64).tiny


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


@njit(cache=True, nogil=True)
def products(
    columns: Array, gap_s: Array, white: Array, slow: Array, tau_s: Array, processes: Array
) -> tuple[Array, Array]:
    """Products (g, k, k) of columns with each other, made white under each noise, and log-determinants (g,).

    slow, tau_s  (g, m) as in `whiten`, of which the first `processes` (g,) count
    """
    k = columns.shape[1]
    grams, logdets = np.zeros((len(slow), k, k)), np.empty(len(slow))
    for g in range(len(slow)):
        m = processes[g]
        whitened, logdets[g] = whiten(columns, gap_s, white, slow[g, :m].copy(), tau_s[g, :m].copy())
        grams[g] = whitened.T @ whitened
    return grams, logdets


@njit(cache=True, nogil=True)
def profile(grams: Array, other_gram: Array, free: int, least: float) -> tuple[Array, Array, Array, Array]:
    """Noise levels of one channel by iteration, the sums of squares at these levels, and log-determinants.

    grams       (g, p + 1, p + 1) of one channel, its residual last; `other_gram` (p + 1, p + 1) of the other channels
    free        rows; the parameters that this channel determines are subtracted
    least       smallest level

    Columns that are zero in this channel, or in all others, do not depend on the level: they are eliminated before.

    Returns levels, sums of squares of this channel (before its level) and of the others, log det of the normal matrix.
    """
    n, p = len(grams), len(other_gram) - 1
    in_own, in_others = np.zeros(p, dtype=np.bool_), np.zeros(p, dtype=np.bool_)
    for k in range(p):
        in_own[k], in_others[k] = grams[:, k, k].max() > 0, other_gram[k, k] > 0
    own, others = np.flatnonzero(~in_others), np.flatnonzero(in_others & ~in_own)
    shared = np.flatnonzero(in_own & in_others)
    q = len(shared)
    rounds = LEVEL_ROUNDS if q else 2  # parameters of one channel alone let its level settle at once
    other_part, other_logdet = set_aside(other_gram, others, shared)
    levels, own_left, other_left, logdets = np.ones(n), np.zeros(n), np.zeros(n), np.zeros(n)
    for g in range(n):
        own_part, own_logdet = set_aside(grams[g], own, shared)
        for _ in range(rounds):
            scaled = own_part / levels[g] ** 2
            normal = scaled[:q, :q] + other_part[:q, :q]
            sides = np.hstack((scaled[:q, q:] + other_part[:q, q:], scaled[:q, :q]))
            solved, logdet = eliminate(normal, sides)
            theta = np.append(-solved[:, 0], 1.0)
            own_left[g], other_left[g] = theta @ own_part @ theta, theta @ other_part @ theta
            logdets[g] = logdet + other_logdet + own_logdet - 2 * len(own) * np.log(levels[g])
            variance = max(own_left[g], 0.0) / max(free - len(own) - np.trace(solved[:, 1:]), 1.0)
            levels[g] = max(np.sqrt(variance), least)
    return levels, own_left, other_left, logdets


@njit(cache=True, nogil=True)
def set_aside(gram: Array, first: NDArray[np.intp], others: NDArray[np.intp]) -> tuple[Array, float]:
    """Products (k + 1, k + 1) of `others` and the last column after elimination of the columns `first` (Schur).

    Also log |det| of `first`. Columns are brought to one size, as in `eliminate`.
    """
    m, count = len(first), len(first) + len(others) + 1
    picked = np.append(np.append(first, others), len(gram) - 1)
    size, U = np.empty(count), np.empty((count, count))
    for i in range(count):
        size[i] = np.sqrt(max(gram[picked[i], picked[i]], TINY))
    for i in range(count):
        for j in range(i, count):
            U[i, j] = gram[picked[i], picked[j]] / (size[i] * size[j])
        U[i, i] += RIDGE if i < count - 1 else 0.0
    logdet = 0.0
    for i in range(m):
        logdet += np.log(abs(U[i, i])) + 2 * np.log(size[i])
        for r in range(i + 1, count):
            share = U[i, r] / U[i, i]
            for j in range(r, count):
                U[r, j] -= share * U[i, j]
    left = np.empty((count - m, count - m))
    for i in range(m, count):
        for j in range(i, count):
            left[i - m, j - m] = left[j - m, i - m] = U[i, j] * size[i] * size[j]
    return left, logdet


@njit(cache=True, nogil=True)
def eliminate(A: Array, B: Array) -> tuple[Array, float]:
    """A^-1 B (p, k) and log |det A| of a positive definite A (p, p), which needs no pivots.

    Rows and columns are brought to one size first: channels may differ in noise by as much as numbers can tell.
    """
    p, k = B.shape
    size = np.sqrt(np.maximum(np.diag(A), TINY))
    U, X = A / np.outer(size, size) + RIDGE * np.eye(p), B / size.reshape(p, 1)
    logdet = 2 * np.sum(np.log(size))
    for i in range(p):
        logdet += np.log(abs(U[i, i]))
        for r in range(i + 1, p):
            share = U[r, i] / U[i, i]
            for j in range(i + 1, p):
                U[r, j] -= share * U[i, j]
            for j in range(k):
                X[r, j] -= share * X[i, j]
    for i in range(p - 1, -1, -1):
        for j in range(k):
            for r in range(i + 1, p):
                X[i, j] -= U[i, r] * X[r, j]
            X[i, j] /= U[i, i]
    return X / size.reshape(p, 1), logdet
