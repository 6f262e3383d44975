"""Smooth functions whose coefficients have independent priors of one variance.

A function f = B b with the roughness penalty b' S b is a Gaussian prior of precision S / tau^2. The null space of S
(the constant, or constant and line) is removed, and the rest is turned so that S becomes the identity:
f = Z u, u ~ N(0, tau^2 I). Columns are ordered from smooth to rough.

Source  Wood, Generalized Additive Models (2nd ed., 2017), 5.8 and 6.6.1; Eilers and Marx, Stat. Sci. 11 (1996) 89.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
import scipy  # scipy.interpolate loads slowly: it is imported at its first use
from numpy.typing import NDArray
from scipy.special import ndtr

from calibrations.table import Array

DEGREE = 3
NULL = 1e-7  # of the largest eigenvalue: an eigenvector below it is in the null space


@dataclass(frozen=True)
class Spline:
    """A cubic spline over `low` .. `high`, constant beyond. Its roughness is the mean square derivative of `order`."""

    low: float
    high: float
    intervals: int
    order: int = 2
    kind: Literal["spline"] = "spline"

    @property
    def count(self) -> int:
        """Number of columns."""
        return self.intervals + DEGREE - self.order

    @property
    def on_splines(self) -> Array:
        """The columns as sums of cubic B-splines on knots of equal distance, shape (intervals + 3, count)."""
        return _diagonalise_penalty(self.low, self.high, self.intervals, self.order)[1]

    def __call__(self, x: Array) -> Array:
        """Columns at x (n,), shape (n, count)."""
        numbers, weights = self._weights(x)
        splines = np.zeros((len(x), self.intervals + DEGREE))
        np.put_along_axis(splines, numbers, weights, axis=1)
        return np.asarray(splines @ self.on_splines)

    def sum_columns(self, x: Array, coefficients: Array) -> Array:
        """The sum of the first columns with these coefficients at x (n,), shape (n,): faster than its columns."""
        numbers, weights = self._weights(x)
        on_splines = self.on_splines[:, : len(coefficients)] @ coefficients
        return np.asarray(np.sum(on_splines[numbers] * weights, axis=1))

    def _weights(self, x: Array) -> tuple[NDArray[np.intp], Array]:
        """Numbers and values of the four B-splines that are not 0 at x (n,), shape (n, 4) each."""
        knot_units = np.clip(
            (x - self.low) * (self.intervals / (self.high - self.low)), 0.0, self.intervals * (1 - 1e-12)
        )
        first = knot_units.astype(np.intp)
        t = knot_units - first
        s = 1 - t
        weights = np.stack([s**3, 4 - 3 * t * t * (2 - t), 4 - 3 * s * s * (2 - s), t**3], axis=1) / 6
        return first[:, None] + np.arange(DEGREE + 1), weights


@lru_cache(maxsize=256)
def _diagonalise_penalty(low: float, high: float, intervals: int, order: int) -> tuple[Array, Array]:
    """Knots, and the matrix (B-splines, count) that turns the penalty into the identity."""
    step = (high - low) / intervals
    knots = low + step * np.arange(-DEGREE, intervals + DEGREE + 1)
    splines = len(knots) - DEGREE - 1
    nodes, weights = np.polynomial.legendre.leggauss(4)
    nodes_at = (low + step * (np.arange(intervals)[:, None] + (nodes + 1) / 2)).ravel()
    derivative = scipy.interpolate.BSpline(knots, np.eye(splines), DEGREE).derivative(order)(nodes_at) * step**order
    penalty = derivative.T @ (np.tile(weights / 2, intervals)[:, None] * derivative)
    values, vectors = np.linalg.eigh(penalty)
    penalised = values > NULL * values[-1]
    return np.asarray(knots), np.asarray(vectors[:, penalised] / np.sqrt(values[penalised]), dtype=np.float64)


def spline(x: Array, most: int = 14, order: int = 2, margin: float = 0.03) -> Spline:
    """A spline over the range of x with as many intervals as its distinct values bear, at most `most`."""
    span = float(np.ptp(x)) or 1.0
    distinct = len(np.unique(np.round((x - x.min()) / span, 4)))
    intervals = max(2, min(most, distinct - order))
    return Spline(float(x.min()) - margin * span, float(x.max()) + margin * span, intervals, order)


@dataclass(frozen=True)
class Harmonics:
    """cos and sin of k x, k = least .. most, over (k / least)^power: a function with that many derivatives."""

    least: int
    most: int
    power: float = 2.0
    kind: Literal["harmonics"] = "harmonics"

    @property
    def count(self) -> int:
        """Number of columns."""
        return 2 * (self.most - self.least + 1)

    def __call__(self, x: Array) -> Array:
        """Columns at x (n,), in rad, shape (n, count)."""
        k = np.arange(self.least, self.most + 1)
        turned = np.outer(x, k)
        pairs = np.stack([np.cos(turned), np.sin(turned)], axis=2) / ((k / self.least) ** self.power)[:, None]
        return np.asarray(pairs.reshape(len(x), -1))


@dataclass(frozen=True)
class Waves:
    """Cosines of k half waves over begin .. begin + span with variances k^-power: 1 is flicker, 2 a random walk."""

    begin: float
    span: float
    count: int
    power: float
    kind: Literal["waves"] = "waves"

    def __call__(self, x: Array) -> Array:
        """Columns at x (n,), shape (n, count)."""
        k = np.arange(1, self.count + 1)
        return np.asarray(np.cos(np.pi * np.outer((x - self.begin) / self.span, k)) * k ** (-self.power / 2))


@dataclass(frozen=True)
class StraightLine:
    """A straight line, 0 in the middle of low .. high and +-1 at the ends."""

    low: float
    high: float
    kind: Literal["line"] = "line"

    @property
    def count(self) -> int:
        """One column."""
        return 1

    def __call__(self, x: Array) -> Array:
        """The column at x (n,), shape (n, 1)."""
        return np.asarray((x - (self.low + self.high) / 2)[:, None] / self.half_width)

    @property
    def half_width(self) -> float:
        """Half of high - low; 1 if they are equal."""
        return (self.high - self.low) / 2 or 1.0


@dataclass(frozen=True)
class Settling:
    """A spline over log(1 + (x - begin) / shortest), constant after `begin + span`: many time constants at once.

    A spline over time itself is as rough at the end of a record as at its beginning, where things settle.
    """

    begin: float
    span: float
    shortest: float
    intervals: int
    kind: Literal["settling"] = "settling"

    @property
    def count(self) -> int:
        """Number of columns."""
        return self._over_age.count

    @property
    def _over_age(self) -> Spline:
        return Spline(0.0, float(np.log1p(self.span / self.shortest)), self.intervals, order=1)

    def __call__(self, x: Array) -> Array:
        """Columns at x (n,), shape (n, count)."""
        return self._over_age(np.log1p(np.maximum(x - self.begin, 0.0) / self.shortest))


@dataclass(frozen=True)
class Clips:
    """x clipped at each width, over the width: a sum of dead zones of many widths."""

    widths: tuple[float, ...]
    kind: Literal["clips"] = "clips"

    @property
    def count(self) -> int:
        """Number of columns."""
        return len(self.widths)

    def __call__(self, x: Array) -> Array:
        """Columns at x (n,), shape (n, count)."""
        widths = np.array(self.widths)
        return np.asarray(np.clip(x[:, None], -widths, widths) / widths)


@dataclass(frozen=True)
class Steps:
    """A step of height 1 at each of `positions`, as the mean of samples with the standard deviation `width` has it."""

    positions: tuple[float, ...]
    width: float = 0.0
    kind: Literal["steps"] = "steps"

    @property
    def count(self) -> int:
        """Number of columns."""
        return len(self.positions)

    def __call__(self, x: Array) -> Array:
        """Columns at x (n,), from -1/2 below to 1/2 above each step, shape (n, count)."""
        beyond = x[:, None] - np.array(self.positions)
        return np.asarray(ndtr(beyond / self.width) - 0.5 if self.width > 0 else np.sign(beyond) / 2)


@dataclass(frozen=True)
class Play:
    """Slip elements that follow x and slip at their widths, over the widths: hysteresis of any shape.

    With `memory` each has another column: the remaining share of its state before the first pose, from 1 to 0.
    """

    widths: tuple[float, ...]
    memory: bool = False
    kind: Literal["play"] = "play"

    @property
    def count(self) -> int:
        """Number of columns."""
        return len(self.widths) * (2 if self.memory else 1)


@dataclass(frozen=True)
class Preisach:
    """For each width, a spline over what follows x behind a play of that width, g: hysteresis that differs from place
    to place.

    Every superposition of relays is such a sum: the relays of one width that are closed are those below the play.
    Source  Brokate and Sprekels, Hysteresis (1996), 2.4.
    """

    widths: tuple[float, ...]
    low: float
    high: float
    intervals: int
    kind: Literal["preisach"] = "preisach"

    @property
    def count(self) -> int:
        """Number of columns."""
        return len(self.widths) * self._over_play.count

    @property
    def _over_play(self) -> Spline:
        return Spline(self.low, self.high, self.intervals, order=1)

    def columns_of(self, plays: Array) -> Array:
        """Columns from what follows behind each play (n, widths), shape (n, count)."""
        return np.column_stack([self._over_play(follower) for follower in plays.T])


@dataclass(frozen=True)
class Products:
    """Products of powers of two or three components of a vector on the sphere, up to a degree."""

    degree: int
    kind: Literal["products"] = "products"

    @property
    def powers(self) -> tuple[tuple[int, int, int], ...]:
        """Exponents of x, y, z; z at most once, as x^2 + y^2 + z^2 = 1."""
        top = range(self.degree + 1)
        return tuple(
            (i, j, m)
            for i in top
            for j in top
            for m in (0, 1)
            if 2 <= i + j + m <= self.degree and i + j <= self.degree and (i > 0) + (j > 0) + (m > 0) > 1
        )

    @property
    def count(self) -> int:
        """Number of products."""
        return len(self.powers)

    def __call__(self, a: Array) -> Array:
        """Columns at vectors a (n, 3), shape (n, count)."""
        i, j, m = np.array(self.powers).T
        x, y = (np.vander(component, self.degree + 1, increasing=True) for component in a.T[:2])
        return np.asarray(x[:, i] * y[:, j] * np.where(m, a[:, 2:], 1.0))


@dataclass(frozen=True)
class Ramp:
    """A constant, the magnitude of x, and x: friction that grows with a load."""

    kind: Literal["ramp"] = "ramp"

    @property
    def count(self) -> int:
        """Three columns."""
        return 3

    def __call__(self, x: Array) -> Array:
        """Columns at x (n,), shape (n, 3)."""
        return np.column_stack([np.ones(len(x)), np.abs(x), x])


Basis = Spline | Harmonics | Waves | StraightLine | Settling | Clips | Steps | Play | Preisach | Products | Ramp
