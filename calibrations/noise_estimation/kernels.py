"""Compiled loops over a grid of noises: on matrices of a few columns each, calls would cost more than the sums."""

from __future__ import annotations

import numpy as np
from numba import njit

from calibrations.kernels import whiten
from calibrations.table import Array

ROUNDS = 3  # in which levels settle
RIDGE = 1e-13  # of each diagonal element
TINY = np.finfo(np.float64).tiny


@njit(cache=True, nogil=True)
def products(
    columns: Array, gap_s: Array, white: Array, slow: Array, tau_s: Array, processes: Array
) -> tuple[Array, Array]:
    """Products (g, k, k) of columns with each other, made white under each noise, and log-determinants (g,).

    slow, tau_s  (g, m) as in `whiten`, of which the first `processes` (g,) count
    """
    k = columns.shape[1]
    found, logdets = np.zeros((len(slow), k, k)), np.empty(len(slow))
    for g in range(len(slow)):
        m = processes[g]
        out, logdets[g] = whiten(columns, gap_s, white, slow[g, :m].copy(), tau_s[g, :m].copy())
        found[g] = out.T @ out
    return found, logdets


@njit(cache=True, nogil=True)
def profiled(grams: Array, rest: Array, free: int, least: float) -> tuple[Array, Array, Array, Array]:
    """Each noise's level, found in rounds beside `rest`, what that leaves of the sums of squares, log-determinants.

    grams   (g, p + 1, p + 1) of one channel, its residual last; rest (p + 1, p + 1) of the other channels
    free    rows; parameters that this channel bears are taken off
    least   level

    Returns levels, squares left in this channel (before the level) and in the others, log det of the normal matrix.
    """
    n, p = len(grams), len(rest) - 1
    levels, own_left, other_left, logdets = np.ones(n), np.zeros(n), np.zeros(n), np.zeros(n)
    for g in range(n):
        gram = grams[g].copy()
        for _ in range(ROUNDS):
            own = gram / levels[g] ** 2
            normal = own[:p, :p] + rest[:p, :p]
            sides = np.hstack((own[:p, p:] + rest[:p, p:], own[:p, :p]))
            solved, logdets[g] = eliminated(normal, sides)
            theta = np.append(-solved[:, 0], 1.0)
            own_left[g], other_left[g] = theta @ gram @ theta, theta @ rest @ theta
            variance = max(own_left[g], 0.0) / max(free - np.trace(solved[:, 1:]), 1.0)
            levels[g] = max(np.sqrt(variance), least)
    return levels, own_left, other_left, logdets


@njit(cache=True, nogil=True)
def eliminated(A: Array, B: Array) -> tuple[Array, float]:
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
