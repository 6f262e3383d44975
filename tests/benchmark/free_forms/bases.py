"""Bases of smooth functions whose coefficients have independent priors of one variance.

A function f = B b with the penalty b' S b is a Gaussian prior of precision S / tau^2. The null space of S (constant,
or constant and line) is removed, and the rest turned so that S becomes the identity: f = Z u, u ~ N(0, tau^2 I).

Source  Wood, Generalized Additive Models (2nd ed., 2017), 5.8 and 6.6.1; Eilers and Marx, Stat. Sci. 11 (1996) 89.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from tests.benchmark.free_forms.measurement import Array

DEGREE = 3
NULL = 1e-7  # of the largest eigenvalue: an eigenvector below it is in the null space


@dataclass(frozen=True, eq=False)
class Spline:
    """A cubic spline without the null space of its roughness penalty. Beyond `low` .. `high` it stays constant."""

    low: float
    high: float
    knots: Array
    turn: Array  # (B-splines, columns)

    @staticmethod
    def over(low: float, high: float, intervals: int, order: int = 2) -> Spline:
        """Roughness: the mean square of the derivative of that order, of which polynomials below it have none."""
        step = (high - low) / intervals
        knots = low + step * np.arange(-DEGREE, intervals + DEGREE + 1)
        count = len(knots) - DEGREE - 1
        nodes, weights = np.polynomial.legendre.leggauss(4)
        at = (low + step * (np.arange(intervals)[:, None] + (nodes + 1) / 2)).ravel()
        derivative = BSpline(knots, np.eye(count), DEGREE).derivative(order)(at) * step**order
        penalty = derivative.T @ (np.tile(weights, intervals)[:, None] * derivative)
        values, vectors = np.linalg.eigh(penalty)
        kept = values > NULL * values[-1]
        return Spline(low, high, knots, vectors[:, kept] / np.sqrt(values[kept]))

    def __call__(self, x: Array) -> Array:
        """Columns at x, shape (n, columns)."""
        inside = np.clip(x, self.low, self.high - 1e-12 * (self.high - self.low))
        return np.asarray(BSpline.design_matrix(inside, self.knots, DEGREE).toarray() @ self.turn)


def spline(x: Array, most: int = 14, order: int = 2, margin: float = 0.03) -> Spline:
    """A spline over the range of x with as many intervals as its distinct values bear, at most `most`."""
    span = float(np.ptp(x)) or 1.0
    distinct = len(np.unique(np.round((x - x.min()) / span, 4)))
    intervals = max(2, min(most, distinct - order))
    return Spline.over(float(x.min()) - margin * span, float(x.max()) + margin * span, intervals, order)


def harmonics(angle: Array, most: int, power: float = 2.0, least: int = 1) -> Array:
    """cos and sin of k angle, k = least .. most, over k^power: the prior of a function with that many derivatives."""
    k = np.arange(least, most + 1)
    turned = np.outer(angle, k)
    return np.asarray(np.hstack([np.cos(turned), np.sin(turned)]) / np.tile((k / least) ** power, 2))


def waves(u: Array, most: int, power: float) -> Array:
    """Cosines of k half waves over u = 0 .. 1 with variances k^-power: 1 is flicker noise, 2 a random walk."""
    k = np.arange(1, most + 1)
    return np.asarray(np.cos(np.pi * np.outer(u, k)) * k ** (-power / 2))


def play(driver: Array, between: Array, widths: Array) -> Array:
    """Forces of slip elements (n, axes, widths) that follow a driver (n, axes) and slip at their widths.

    between  (n, points, axes) where the driver turns round before each row
    """
    held = np.zeros((driver.shape[1], len(widths)))
    last = np.zeros(driver.shape[1])
    out = np.empty((*driver.shape, len(widths)))
    path = np.concatenate([between, driver[:, None]], axis=1)
    for i, points in enumerate(path):
        for here in points:
            held = np.minimum(np.maximum(held + (here - last)[:, None], -widths), widths)
            last = here
        out[i] = held
    return out
