"""Slow noise of outputs whose magnitude alone is fitted: how much less certain it makes the parameters.

A position tells the magnitude, and slow noise of an output is in it by as much as the output counts in that position.
So the residual of two positions is correlated by the product of their directions: slow noise looks like scatter, and is
a bias all the same. The covariance of the residual under slow noise of each output is

    K = s^2 (W + rho^2 w^2 (D D^T) o C)

W   white noise of the magnitudes; w^2 its mean over the mean square of D, the white variance of an output
D   derivatives of the residual by the outputs, shape (n, axes); o the product by elements
C   correlation of the slow noise from time to time; rho slow noise over white; s found by the residual

The variance of each parameter, by the gain of the fit, is the mean over the noise that `noise_fit.allowed` lists, each
weighted by its restricted likelihood, as for rows of one output.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from calibrations.fitting.identifiability import gain
from calibrations.fitting.noise_fit import NO_SLOW, possible_slow_noise
from calibrations.means.noise import Noise
from calibrations.table import Array

MOST_ROWS = 200  # of the matrices; more rows are thinned evenly


def widen_by_magnitudes(noise: Noise, residual: Array, jacobian: Array, by_output: Array, typical: Array) -> Array:
    """Factor on each standard uncertainty under `noise`, shape (p,).

    From residual (1, n), jacobian (1, n, p) and derivatives by the outputs (1, n, axes).
    """
    points = [NO_SLOW] if noise.given else possible_slow_noise(noise.gap_s)
    n, p = jacobian.shape[1:]
    if len(points) == 1 or not p or n <= p + 1:
        return np.ones(p)
    stride = -(-n // MOST_ROWS)
    rows = slice(None, None, stride)
    r, J, D, fast = residual[0, rows], jacobian[0, rows], by_output[0, rows], noise.fast[0, rows]
    least = float(np.min(noise.white[0, rows] / fast)) ** 2 if noise.known else 0.0
    t_s = np.cumsum(noise.gap_s)[rows]
    G = gain(J / fast[:, None], typical) / fast
    white_variance = np.einsum("pn,n,pn->p", G, fast**2, G)
    output = np.mean(fast**2) / np.mean(np.sum(D**2, axis=1))
    apart_s, directions = np.abs(t_s[:, None] - t_s), D @ D.T
    scores, variances = [], []
    for ratio, taus_s in points:
        slow = sum((np.exp(-apart_s / tau_s) for tau_s in taus_s), np.zeros_like(apart_s)) / len(taus_s)
        K = np.diag(fast**2) + ratio**2 * output * directions * slow
        score, level = _score(K, r, J / typical, least)
        scores.append(score)
        variances.append(level * np.einsum("pn,nm,pm->p", G, K, G))
    weight = np.exp(-(np.array(scores) - min(scores)) / 2) * np.append(len(points) - 1, np.ones(len(points) - 1))
    mean = weight @ np.array(variances) / weight.sum()
    wider = 1 + stride * (
        mean / np.where(white_variance > 0, white_variance, np.inf) - 1
    )  # thinning leaves slow noise, and adds white
    return np.sqrt(np.where((white_variance > 0) & (wider > 0), wider, 1.0))


def _score(K: Array, r: Array, J: Array, least: float) -> tuple[float, float]:
    """-2 log restricted likelihood up to a constant of the data, and the factor on all variances."""
    factor = cho_factor(K)
    Q = np.linalg.qr(J)[0]  # the likelihood depends on what the columns span alone
    solved = cho_solve(factor, np.column_stack([Q, r]))
    normal = Q.T @ solved[:, :-1]
    side = Q.T @ solved[:, -1]
    square = float(r @ solved[:, -1] - side @ np.linalg.solve(normal, side))
    free = len(r) - Q.shape[1]
    level = max(square / free, least, np.finfo(float).tiny)
    logdet = 2 * float(np.sum(np.log(np.abs(np.diag(factor[0]))))) + float(np.linalg.slogdet(normal)[1])
    return logdet + square / level + free * float(np.log(level)), level
