"""Coefficients of a spectrum that is a sum of known shapes, none of them negative, by maximum likelihood.

    log L = -1/2 sum nu (log S + I/S)        S = G theta: expected, I: seen with nu degrees of freedom

Fisher's scoring is a least-squares fit with the weights nu / (2 S^2), repeated; a step that does not raise the
likelihood is halved. A few multiplicative steps before, each of which raises it from anywhere, come near enough.

Source  Whittle, Ark. Mat. 2 (1953); Fevotte, Bertin and Durrieu, Neural Comput. 21 (2009): multiplicative steps.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from calibrations.table import Array

NEAR, MOST, SWEEPS = 20, 100, 200
CLOSE = 1e-9


@njit(cache=True, nogil=True)
def log_likelihood(expected: Array, seen: Array, freedom: Array) -> float:
    """But for a constant."""
    return -0.5 * float(np.sum(freedom * (np.log(expected) + seen / expected)))


@njit(cache=True, nogil=True)
def maximise(G: Array, seen: Array, freedom: Array, base: Array) -> tuple[Array, float]:
    """(theta, log L) of S = base + G theta; G (b, p) with p of 1 or more, all others (b,)."""
    p = G.shape[1]
    theta = np.zeros(p)
    for j in range(p):
        theta[j] = np.exp(np.sum(freedom * np.log(seen / G[:, j])) / np.sum(freedom)) / p
    for _ in range(NEAR):
        S = base + G @ theta
        for j in range(p):
            theta[j] *= np.sqrt(np.sum(freedom * G[:, j] * seen / S**2) / np.sum(freedom * G[:, j] / S))
    value = log_likelihood(base + G @ theta, seen, freedom)
    for _ in range(MOST):
        step = _scored(G, seen, freedom, base, theta) - theta
        length = 1.0
        while length > 1e-4:
            there = theta + length * step
            S = base + G @ there
            if S.min() > 0.0:
                better = log_likelihood(S, seen, freedom)
                if better >= value:
                    break
            length /= 2
        if length <= 1e-4:
            break
        gained = better - value
        theta, value = there, better
        if gained < CLOSE:
            break
    return theta, value


@njit(cache=True, nogil=True)
def _scored(G: Array, seen: Array, freedom: Array, base: Array, theta: Array) -> Array:
    """Where the weighted least squares without negative coefficients has its minimum: coordinate by coordinate."""
    p = len(theta)
    S = base + G @ theta
    weighted = G / (S**2 / freedom).reshape(-1, 1)
    A, r = G.T @ weighted, weighted.T @ (seen - base)
    found = theta.copy()
    for _ in range(SWEEPS):
        change = 0.0
        for j in range(p):
            best = max(0.0, found[j] + (r[j] - np.dot(A[j], found)) / A[j, j])
            change = max(change, abs(best - found[j]) * np.sqrt(A[j, j]))
            found[j] = best
        if change < 1e-8:
            break
    return found


def information(columns: Array, expected: Array, freedom: Array) -> Array:
    """Fisher's information on the coefficients of columns (b, p) of the spectrum's derivative, shape (p, p)."""
    scaled = columns * np.sqrt(freedom / 2)[:, None] / expected[:, None]
    return scaled.T @ scaled
