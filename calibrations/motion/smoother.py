"""Smoothing of motion that is no sine: the Kalman smoother of an integrated random walk, its noise fitted.

    x_k = s_k + e_k        D^3 s = w        e of variance r, w of variance q white

The smoothed s solves (I + (r / q) D^3' D^3) s = x, a banded system: it equals the forward and backward passes of
Rauch, Tung and Striebel with a diffuse start, and is a discrete smoothing spline of fifth degree (Wahba, 1990); r / q
is that of greatest restricted likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.optimize import minimize_scalar

from calibrations.motion.spectrum import Complex
from calibrations.table import Array

ORDER = 3  # so that acceleration still has a derivative of finite variance
LOG_RANGE = (float(np.log(1e-3)), float(np.log(1e12)))  # of r / q: noise far below the motion; rounding beyond


@dataclass(frozen=True)
class Smoothed:
    """A smoothed record, r / q, and the standard deviation of what was taken for noise."""

    values: Array
    ratio: float
    noise_std: float

    def response(self, f: Array, rate_hz: float) -> Complex:
        """What the smoother does to a sine, away from the ends: no phase, 1 / (1 + r / q (2 sin(pi f / rate))^6)."""
        return np.asarray(1 / (1 + self.ratio * (2 * np.sin(np.pi * f / rate_hz)) ** (2 * ORDER)), dtype=complex)

    def corner_hz(self, rate_hz: float) -> float:
        """Where half of the amplitude is left."""
        return float(rate_hz / np.pi * np.arcsin(min(1.0, self.ratio ** (-1 / (2 * ORDER)) / 2)))

    def edge_s(self, rate_hz: float) -> float:
        """How far from the ends fewer samples are averaged: one period at the corner."""
        return 1 / self.corner_hz(rate_hz)


def smooth(x: Array) -> Smoothed:
    """`x`, shape (n,), smoothed."""
    penalty = _penalty(len(x))

    def deviance(log_ratio: float) -> float:
        return _solved(x, penalty, float(np.exp(log_ratio)))[2]

    found = minimize_scalar(deviance, bounds=LOG_RANGE, method="bounded", options={"xatol": 0.05})
    ratio = float(np.exp(found.x))
    values, noise_std, _ = _solved(x, penalty, ratio)
    return Smoothed(values, ratio, noise_std)


def _solved(x: Array, penalty: Array, ratio: float) -> tuple[Array, float, float]:
    """(smoothed, noise, -2 log restricted likelihood up to a constant)."""
    bands = ratio * penalty
    bands[-1] += 1.0
    factor = cholesky_banded(bands)
    values = cho_solve_banded((factor, False), x)
    free = len(x) - ORDER
    variance = max(float(x @ (x - values)) / free, np.finfo(float).tiny)
    deviance = free * (np.log(variance) - np.log(ratio)) + 2 * float(np.sum(np.log(factor[-1])))
    return values, float(np.sqrt(variance)), deviance


def _penalty(n: int) -> Array:
    """D^3' D^3 as upper bands, shape (ORDER + 1, n)."""
    weights = np.array([-1.0, 3.0, -3.0, 1.0])
    bands = np.zeros((ORDER + 1, n))
    for i in range(ORDER + 1):
        for j in range(i, ORDER + 1):
            bands[ORDER - (j - i), j : n - ORDER + j] += weights[i] * weights[j]
    return bands
