"""Information of planned poses on a model's parameters (Fisher, to first order), and the poses with the most of it.

    M = J' Sigma^-1 J        J the model's derivatives at the fitted values, Sigma the expected noise

The rows Sigma^(-1/2) J of independent data are stacked: the information of both is the sum.

The poses with the most information are a D- or I-optimal design, by exchange of one pose after another:

    D   the greatest det M: the smallest volume of the parameters' joint uncertainty
    I   the least mean variance of the prediction over a range of poses: tr(M^-1 W)

Here M is the information of the chosen poses, and W the mean of J' J over the range. Each pose in turn is replaced by
the best of all candidates until no exchange improves the design. There are several random starts, because the optimum
of each is local.

Some of the chosen poses are measured again: the data then give the noise itself (pure error), and a lack of fit can
be separated from it. Poses far from all others are added as check poses, which no fit uses.

Source  Fedorov, Theory of Optimal Experiments (1972), exchange; Atkinson, Donev and Tobias, Optimum Experimental
        Designs, with SAS (2007), ch. 9 to 12; Pronzato, Automatica 44 (2008), 303-325, on effects that are not linear;
        Kennard and Stone, Technometrics 11 (1969), 137-148, poses far from all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from calibrations.fitting.fit import Fit
from calibrations.fitting.identifiability import RELATIVE_RANK, UNDETERMINED
from calibrations.fitting.problem import Problem
from calibrations.means.noise import Noise, rms
from calibrations.table import Array, Table

NOTHING = 1e-12  # of the largest column: a smaller one is rounding, as the out-of-plane axis of a level turn


def information(fit: Fit, table: Table) -> Array:
    """Derivatives of the model at the fitted values on another `table`, made white, shape (axes * n, parameters).

    A block of rows for each axis, in order of time; a row is in units of its own noise, a column in 1 over the
    parameter's unit. White noise is that of the table's means, scatter that of the fit. Slow noise too is as the fit
    found it: correlated over the table's own times or, where it has none, added as if each row had its own.
    """
    problem = fit.problem.on(table.rows(table.order))
    return np.asarray(_noise(fit, problem).whiten(problem.jacobian(fit.theta)))


def covariance_of(rows: Array) -> Array:
    """Covariance of the parameters that `rows` (rows, parameters) determine, shape (parameters, parameters).

    Infinite on the diagonal for a parameter that they leave undetermined.
    """
    p = rows.shape[1]
    size = np.linalg.norm(rows, axis=0)
    scale = np.where(size > NOTHING * size.max(initial=0.0), size, np.inf)
    _, s, Vt = np.linalg.svd(np.vstack([rows / scale, np.zeros((p, p))]), full_matrices=False)
    determined = s > RELATIVE_RANK * s[0]
    root = Vt[determined].T / s[determined] / scale[:, None]
    covariance = root @ root.T
    free = np.sum(Vt[~determined] ** 2, axis=0) > UNDETERMINED
    covariance[free, free] = np.inf
    return np.asarray(covariance)


def noise_on_rows(noise: Noise, problem: Problem) -> Noise:
    """The noise of a fit for the rows of another problem: white noise by their means, the rest as in the fit."""
    white = np.zeros((len(problem.channels), problem.table.n)) if problem.white is None else problem.white
    noise_there = replace(noise, white=white, gap_s=problem.gap_s)
    return replace(noise_there, ratio=noise.slow / rms(noise_there.fast))


def _noise(fit: Fit, problem: Problem) -> Noise:
    """The fit's noise for the rows of another problem; with times, its flicker noise continues beyond the record."""
    noise = fit.noise.prolonged() if "t_s" in problem.table else fit.noise
    if "t_s" not in problem.table:
        noise = replace(noise, scatter=np.hypot(noise.scatter, noise.slow), ratio=0 * noise.ratio)
    return noise_on_rows(noise, problem)


Chosen = NDArray[np.intp]  # numbers of candidates; one that is measured twice is there twice

STARTS = 3
MOST_PASSES = 30
RIDGE = 1e-6  # of the candidates' mean information: what makes a beginning solvable that knows too little
LEAST_GAIN = 1e-9  # of the gain that the present pose has: less is rounding


class Criterion(Protocol):
    """The criterion of a design. Covariances are of scaled parameters, (p, p)."""

    def gain(self, covariance: Array, rows: Array) -> Array:
        """The improvement of a design by each of `rows` (candidates, axes, p); the largest is best."""

    def loss(self, covariance: Array) -> float:
        """The loss of a design; the smallest is best."""


@dataclass(frozen=True)
class DOptimal:
    """The volume of the parameters' joint uncertainty."""

    def gain(self, covariance: Array, rows: Array) -> Array:
        return np.asarray(np.linalg.slogdet(_prediction_matrices(rows @ covariance, rows))[1])

    def loss(self, covariance: Array) -> float:
        return float(np.linalg.slogdet(covariance)[1])


@dataclass(frozen=True)
class IOptimal:
    """The mean variance of the predictions; `weight` (p, p) is the mean of J' J over the range."""

    weight: Array

    @staticmethod
    def over(rows: Array) -> IOptimal:
        """The criterion for a range, of which `rows` (poses, axes, p) are a uniform sample."""
        return IOptimal(np.einsum("iap,iaq->pq", rows, rows) / len(rows))

    def gain(self, covariance: Array, rows: Array) -> Array:
        JC = rows @ covariance
        weighted = JC @ self.weight @ JC.transpose(0, 2, 1)
        return np.asarray(np.trace(np.linalg.solve(_prediction_matrices(JC, rows), weighted), axis1=1, axis2=2))

    def loss(self, covariance: Array) -> float:
        return float(np.sum(covariance * self.weight))


def scale_rows(rows: Array) -> Array:
    """Each parameter in the unit in which the candidates' mean information is 1; `rows` is (candidates, axes, p)."""
    size = np.sqrt(np.mean(np.sum(rows**2, axis=1), axis=0))
    return rows / np.where(size > 0, size, 1.0)


def exchange_design(rows: Array, poses: int, criterion: Criterion) -> Chosen:
    """The best design of `poses` poses among the scaled `rows` (candidates, axes, p), shape (poses,).

    The same arguments give the same design.
    """
    rng = np.random.default_rng(0)
    designs = [_improve(rows, rng.integers(0, len(rows), poses), criterion, rng) for _ in range(STARTS)]
    return min(designs, key=lambda design: criterion.loss(_covariance(rows[design])))


def information_gain(measured: Array, candidates: Array, criterion: Criterion) -> Array:
    """Information of each of the scaled `candidates` (candidates, axes, p) besides the rows `measured` (n, axes, p).

    Shape (candidates,). With few rows measured, or none, a small ridge makes the information solvable.
    """
    return criterion.gain(_covariance(measured), candidates)


def choose_repeats(rows: Array, design: Chosen, count: int, criterion: Criterion) -> Chosen:
    """The poses of `design` to measure once more, each at most once, in the order of their gain; shape (more,)."""
    remaining, repeats = [int(k) for k in np.unique(design)], list[int]()
    for _ in range(min(count, len(remaining))):
        covariance = _covariance(rows[np.concatenate([design, np.array(repeats, dtype=np.intp)])])
        repeats.append(remaining.pop(int(np.argmax(criterion.gain(covariance, rows[remaining])))))
    return np.array(repeats, dtype=np.intp)


def farthest_poses(places: Array, design: Chosen, count: int) -> Chosen:
    """The `places` (candidates, k) that are farthest from all `design` and from each other, one by one; (count,)."""
    nearest = np.min(np.linalg.norm(places[:, None] - places[None, np.unique(design)], axis=2), axis=1)
    farthest: list[int] = []
    for _ in range(count):
        farthest.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(places - places[farthest[-1]], axis=1))
    return np.array(farthest, dtype=np.intp)


def _improve(rows: Array, design: Chosen, criterion: Criterion, rng: np.random.Generator) -> Chosen:
    """Exchange pose by pose until a whole pass changes nothing. The first one of equals in a random order is chosen."""
    shuffled = rng.permutation(len(rows))
    for _ in range(MOST_PASSES):
        previous = design.copy()
        for k in range(len(design)):
            covariance = _covariance(rows[np.delete(design, k)])
            gains = criterion.gain(covariance, rows)
            best = shuffled[np.argmax(gains[shuffled])]
            if gains[best] > gains[design[k]] * (1 + LEAST_GAIN):
                design[k] = best
        if np.array_equal(previous, design):
            break
    return design


def _covariance(rows: Array) -> Array:
    """Covariance of the scaled parameters, shape (p, p)."""
    flat = rows.reshape(-1, rows.shape[2])
    return np.asarray(np.linalg.inv(flat.T @ flat + RIDGE * np.eye(flat.shape[1])))


def _prediction_matrices(JC: Array, rows: Array) -> Array:
    """I + J C J' of each candidate, shape (candidates, axes, axes)."""
    return np.asarray(np.eye(rows.shape[1]) + JC @ rows.transpose(0, 2, 1))
