"""Joint least-squares estimate of a model's parameters, with uncertainties that allow for slow noise.

Parameters and noise are estimated in turn: least squares under the present noise, then the noise of greatest
likelihood given the residual, until neither moves. Where the model does not describe the data, its parameters are less
certain than the noise alone makes them: standard uncertainties are widened by the Birge ratio.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from calibrations.model import Model
from calibrations.noise import Noise, rms, white_only
from calibrations.noise_estimation.noise_average import widening
from calibrations.noise_estimation.noise_fit import estimate
from calibrations.problem import Problem
from calibrations.search.identify import RELATIVE_RANK, estimates
from calibrations.table import Array, Table

ROUNDS = 2
NEWTON_STEPS = 20
STRAIGHT = 1e-6  # of what is left: a step that foretells it better is a linear model's
SMALL_GAIN = 1e-6  # of a sum of squares whose unit is the noise


@dataclass(frozen=True, eq=False)
class Fit:
    """A model fitted to a table. `residual` has shape (channels, n), rows in order of time.

    `all_noise`: what standard uncertainties were taken from (`cautiously`); None where none were.
    """

    model: Model
    problem: Problem
    theta: Array
    noise: Noise
    residual: Array
    jacobian: Array
    all_noise: Noise | None = None

    @property
    def table(self) -> Table:
        """The table, rows in order of time."""
        return self.problem.table

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the residual's blocks."""
        return self.problem.channels

    @property
    def rmse(self) -> Array:
        """Root mean square of the residual per channel."""
        return rms(self.residual)

    @property
    def excess(self) -> Array:
        """Normalised rms residual per channel: rmse over noise floor."""
        return rms(self.residual) / self.noise.floor

    @property
    def pooled_excess(self) -> float:
        """The excess over all channels together."""
        return float(np.sqrt(np.mean(self.excess**2)))

    @cached_property
    def whitened(self) -> Array:
        """[residual, jacobian] made white, shape (channels * n, 1 + p)."""
        return self.noise.whiten(np.concatenate([self.residual[:, :, None], self.jacobian], axis=2))

    @cached_property
    def birge(self) -> float:
        """Birge ratio: rms of the whitened residual, at least 1. Above 1, the model misses more than noise."""
        rows, p = self.residual.size, len(self.theta)
        return max(1.0, float(np.sqrt(np.sum(self.whitened[:, 0] ** 2) / max(rows - p, 1))))


def fit(model: Model, table: Table) -> Fit:
    """The model with parameters estimated from `table`. Raises TooFewRows, ModelError, DataError."""
    problem = Problem.of(model, table)
    return _alternate(
        problem, white_only(problem.white, problem.gap_s, len(problem.channels), problem.given), problem.layout.starts()
    )


def refit(before: Fit, model: Model, start: Array | None = None) -> Fit:
    """A changed model on the data of `before`, from the noise found there; `start` for all its parameters."""
    problem = Problem.of(model, before.table)
    return _alternate(problem, before.noise, problem.layout.starts() if start is None else [start])


def _alternate(problem: Problem, noise: Noise, starts: list[Array]) -> Fit:
    """Parameters and noise in turn."""
    theta = min((_minimise(problem, noise, start) for start in starts), key=lambda t: t[1])[0]
    # with smooth columns set aside the noise hardly depends on the parameters, and one round is enough
    for _ in range(1 if problem.smooth.size else ROUNDS):
        found = estimate(noise, problem.residual(theta), problem.jacobian(theta), problem.smooth)
        if found.is_like(noise):
            break
        noise = found
        theta, _ = _minimise(problem, noise, theta)
    return _result(problem, theta, noise)


def evaluate(model: Model, table: Table) -> Fit | None:
    """The model with the values that it has, on `table`; None where it has none."""
    problem = Problem.of(model, table)
    theta = problem.layout.known()
    if theta is None:
        return None
    residual, jacobian = problem.residual(theta), problem.jacobian(theta)
    noise = white_only(problem.white, problem.gap_s, len(problem.channels), problem.given)
    noise = estimate(noise, residual, jacobian, problem.smooth)
    return Fit(replace(model, unit=table.unit), problem, theta, noise, residual, jacobian)


def _minimise(problem: Problem, noise: Noise, start: Array) -> tuple[Array, float]:
    """(parameters, cost) of least squares under `noise`."""
    if not len(start):
        return start, 0.0
    if problem.table.kind == "motion":
        return _determined(problem, noise, start)
    at_once = _at_once(problem, noise, start) if problem.adds else None
    if at_once is not None:
        return at_once

    def residual(theta: Array) -> Array:
        return noise.whiten(problem.residual(theta)[:, :, None])[:, 0]

    def descended(start: Array, stairs: bool) -> OptimizeResult:
        def jacobian(theta: Array) -> Array:
            return noise.whiten(problem.jacobian(theta, stairs=stairs))

        return least_squares(
            residual,
            start,
            jac=jacobian,
            bounds=problem.layout.bounds,
            x_scale=problem.layout.typical,
            ftol=1e-9,
            xtol=1e-9,
            gtol=1e-12,
            max_nfev=60,
        )

    answer = descended(start, stairs=False)
    if problem.rounds:
        answer = descended(answer.x, stairs=True)
    return answer.x, float(answer.cost)


def _at_once(problem: Problem, noise: Noise, start: Array) -> tuple[Array, float] | None:
    """As `_minimise`, where one step of Gauss and Newton's gets there: the model is linear. None where it is not."""
    typical, (low, high) = problem.layout.typical, problem.layout.bounds
    columns = np.concatenate([problem.residual(start)[:, :, None], problem.jacobian(start)], axis=2)
    white = noise.whiten(columns)
    J, before = white[:, 1:] * typical, white[:, 0]
    step = np.linalg.lstsq(J, -before, rcond=None)[0]
    theta = start + typical * step
    left = noise.whiten(problem.residual(theta)[:, :, None])[:, 0]
    linear = np.linalg.norm(before + J @ step - left) <= STRAIGHT * np.linalg.norm(left)
    if not linear or np.any(theta < low) or np.any(theta > high):
        return None
    return theta, float(left @ left) / 2


def _determined(problem: Problem, noise: Noise, start: Array) -> tuple[Array, float]:
    """As `_minimise`, by Gauss and Newton's shortest steps: what the data do not determine stays as it began.

    At one attitude an axis that does not move cannot tell its scale factor from its bias.
    """
    typical, (low, high) = problem.layout.typical, problem.layout.bounds

    def white(theta: Array) -> Array:
        return noise.whiten(problem.residual(theta)[:, :, None])[:, 0]

    theta, left = start, white(start)
    for _ in range(NEWTON_STEPS):
        J = noise.whiten(problem.jacobian(theta)) * typical
        size = np.linalg.norm(J, axis=0).max() or 1.0
        step = typical * np.linalg.lstsq(J / size, -left / size, rcond=RELATIVE_RANK)[0]
        tried = [(t, white(t)) for t in (np.clip(theta + share * step, low, high) for share in (1.0, 0.25))]
        after, least = min(tried, key=lambda t: float(t[1] @ t[1]))
        gain = float(left @ left - least @ least)
        if not gain > 0:
            break
        theta, left = after, least
        if gain < SMALL_GAIN:
            break
    return theta, float(left @ left) / 2


def _result(problem: Problem, theta: Array, noise: Noise) -> Fit:
    residual, jacobian = problem.residual(theta), problem.jacobian(theta)
    model = replace(problem.layout.model, unit=problem.table.unit)
    found = Fit(model, problem, theta, noise, residual, jacobian)
    cautious = cautiously(found)
    informative = np.asarray(cautious.whitened[:, 1:] / cautious.birge)
    wider = _wider(cautious)
    return replace(found, model=estimates(model, problem.layout, theta, informative, wider), all_noise=cautious.noise)


def _wider(cautious: Fit) -> Array:
    """Factors on the standard uncertainties; none in a motion, whose parts tell what is slow from what is not."""
    if cautious.table.kind == "motion":
        return np.ones(len(cautious.theta))
    layout = cautious.problem.layout
    return widening(cautious.noise, cautious.residual, cautious.jacobian, layout.typical)


def cautiously(found: Fit) -> Fit:
    """The fit under all the noise that its residual shows, from which standard uncertainties are taken.

    Here nothing is set aside: where inclinations follow each other in time, smooth functions of the angles take up slow
    noise as well, and parameters would look more certain than they are.
    """
    if found.all_noise is not None:
        return replace(found, noise=found.all_noise)
    noise = estimate(found.noise, found.residual, found.jacobian, np.zeros((found.table.n, 0)))
    return replace(found, noise=noise.prolonged())
