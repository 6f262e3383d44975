"""The uncertainty budget of a fit: for each parameter what adds to its standard uncertainty, and how much (GUM).

    type A   white noise of the means and scatter, G W G^T and G k^2 G^T; slow noise, the rest of what the fit's own
             standard uncertainty holds; and the misfit, by which the Birge ratio widens it
    type B   inputs that are not fitted (`inputs.py`): u_i = |c_i| u(x_i), with c_i = G d residual / d x_i

G is the gain of the fit, d theta = -G d residual: the pseudo-inverse of its jacobian under the noise it was found with.
An input with an error of its own in each row adds the squares row by row. Effective degrees of freedom by Welch and
Satterthwaite, the coverage factor for 95 % from Student's t. A source that is not given has no number.

Errors of the inputs show in the residual too, and the fit takes them for scatter, slow noise or misfit. What they
account for there, by the square of the residual that they would leave, is not counted a second time.

Source  JCGM 100:2008, 4.3.10 (nothing counts twice), 5.1 (sensitivities), 5.2 (correlated inputs), G.4 (freedom).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from calibrations.criteria import COVERAGE
from calibrations.fitting.fit import Fit
from calibrations.fitting.identifiability import correlation_matrix, covariance, gain
from calibrations.fitting.inputs import Contribution
from calibrations.means.noise import MOST_CORRELATED_ROWS, Noise
from calibrations.table import Array

SLOW_NOISE = "slow noise"


@dataclass(frozen=True)
class BudgetRow:
    """One source. Arrays have an entry for each parameter, in its unit; None where the source is not given.

    `sensitivity` is signed where the whole table has one error, else the root of the sum of squares.
    """

    source: str
    kind: str  # "A" or "B"
    unit: str
    input_std: float | None
    sensitivity: Array | None
    std: Array | None
    freedom: float


@dataclass(frozen=True)
class Budget:
    """All sources of all parameters of a fit; entries that the data do not determine are NaN."""

    lines: tuple[BudgetRow, ...]

    @property
    def given(self) -> tuple[BudgetRow, ...]:
        """The sources that have a number."""
        return tuple(line for line in self.lines if line.std is not None)

    @property
    def not_given(self) -> tuple[str, ...]:
        """Names of the sources that have none."""
        return tuple(line.source for line in self.lines if line.std is None)

    @cached_property
    def _variances(self) -> Array:
        """Shape (sources, p)."""
        return np.array([line.std for line in self.given]) ** 2

    @cached_property
    def combined(self) -> Array:
        """Combined standard uncertainty of each parameter."""
        return np.asarray(np.sqrt(self._variances.sum(axis=0)))

    @cached_property
    def freedom(self) -> Array:
        """Effective degrees of freedom of each parameter."""
        freedoms = np.array([[line.freedom] for line in self.given])
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.combined**4 / np.sum(self._variances**2 / freedoms, axis=0))

    @cached_property
    def coverage(self) -> Array:
        """Coverage factor of each parameter for 95 %, from the whole degrees of freedom (GUM G.4.1)."""
        whole_freedom = np.minimum(np.maximum(np.floor(np.where(np.isnan(self.freedom), 1e9, self.freedom)), 1), 1e9)
        return np.asarray(stdtrit(whole_freedom, (1 + COVERAGE) / 2))

    @cached_property
    def expanded(self) -> Array:
        """Expanded uncertainty of each parameter."""
        return self.coverage * self.combined


def make_budget(fit: Fit, inputs: Iterable[Contribution]) -> Budget:
    """The budget of a fit to poses or positions, from its own noise and from `inputs` that were not fitted."""
    cautious = fit.in_all_noise()
    G = row_gains(cautious)
    of_inputs = [_of_type_b(fit, G, c) for c in inputs]
    type_a = _of_type_a(cautious, G, sum(square for _, square in of_inputs))
    return Budget((*type_a, *(line for line, _ in of_inputs)))


def row_gains(fit: Fit) -> Array:
    """Derivative of each parameter with respect to the error of each row, shape (p, channels, n)."""
    channels, n = fit.residual.shape
    rows = np.vstack([fit.whitened[:, 1:], fit.problem.layout.prior_rows])
    inverse = gain(rows, fit.problem.layout.typical)[:, : channels * n].reshape(-1, channels, n)
    return fit.noise.whiten_transposed(inverse.transpose(1, 2, 0)).transpose(2, 0, 1)


def _of_type_a(fit: Fit, G: Array, square: float) -> list[BudgetRow]:
    """The lines of type A: the parts of the fit's own covariance.

    `square`: sum of the squares that errors of the inputs leave in the residual. It is not counted twice.
    """
    noise, free_rows = fit.noise, float(fit.residual.size - len(fit.theta))
    variances = np.array([np.nan if e.std is None else e.std for e in fit.params.values()]) ** 2
    by_noise = variances / fit.birge**2
    white = np.minimum(np.einsum("pcn,cn->p", G**2, noise.white**2), by_noise)
    scatter = np.minimum(np.einsum("pcn,c->p", G**2, noise.scatter**2), by_noise - white)
    slow, misfit = by_noise - white - scatter, variances - by_noise
    nonwhite_square = float(np.sum(fit.residual**2) - np.sum(noise.white**2))
    share = min(max(1 - square / nonwhite_square, 0.0), 1.0) if square and nonwhite_square > 0 else 1.0
    parts = [
        ("white noise of the dwells", white, free_rows),
        ("scatter from row to row", share * scatter, free_rows),
        (SLOW_NOISE, share * slow, slow_freedom(noise)),
        ("misfit of the model", share * misfit, free_rows),
    ]
    return [
        BudgetRow(name, "A", "", None, None, np.sqrt(v), freedom)
        for name, v, freedom in parts
        if np.nanmax(v, initial=0.0) > 0
    ]


def _of_type_b(fit: Fit, G: Array, c: Contribution) -> tuple[BudgetRow, float]:
    """The line of an input that is not fitted, and the sum of squares that its errors leave in the residual."""
    if c.std is None:
        return BudgetRow(c.source, "B", c.unit, None, None, None, c.freedom), 0.0
    row_errors, number = _errors_of_rows(fit, c), c.shared(fit.table)
    by_error = input_effects(fit, G, c)
    sensitivity = by_error[0] if len(by_error) == 1 else np.sqrt(np.sum(by_error**2, axis=0))
    line = BudgetRow(c.source, "B", c.unit, c.std, sensitivity, np.abs(sensitivity) * c.std, c.freedom)
    return line, c.std**2 * _remaining_square(row_errors, fit.jacobian, by_error, number)


def input_effects(fit: Fit, G: Array, c: Contribution) -> Array:
    """Change of each parameter by each error of an input, which its rows share, shape (errors, p)."""
    number = c.shared(fit.table)
    by_error = np.zeros((int(number.max()) + 1, len(G)))
    np.add.at(by_error, number, np.einsum("pcn,cn->np", G, _errors_of_rows(fit, c)))
    return by_error


def _errors_of_rows(fit: Fit, c: Contribution) -> Array:
    """Errors of the rows that have the same effect as a unit error of the input, shape (channels, n).

    The residual is measured less predicted: a parameter follows an input against what the residual does.
    """
    return -c.derivative(fit.problem, fit.theta)


def _remaining_square(row_errors: Array, jacobian: Array, by_error: Array, number: NDArray[np.intp]) -> float:
    """Residual sum of squares by errors (channels, n), after the parameters have changed by `by_error`.

    One error for each `number`; the jacobian (channels, n, p) takes `by_error` (numbers, p) back to the rows.
    """
    crossed = np.einsum("cnp,np->cn", jacobian, by_error[number])
    normal = np.einsum("cnp,cnq->pq", jacobian, jacobian)
    return float(np.sum(row_errors**2) - 2 * np.sum(row_errors * crossed) + np.sum((by_error @ normal) * by_error))


def slow_freedom(noise: Noise) -> float:
    """Degrees of freedom with which slow noise is known: of the sum of squares of so correlated a record.

    (tr R)^2 / tr R^2 for its correlation R (Satterthwaite); the least over the channels.
    """
    time_s = np.cumsum(noise.gap_s)
    time_s = time_s[:: max(1, len(time_s) // MOST_CORRELATED_ROWS)]
    apart_s = np.abs(time_s[:, None] - time_s)
    freedom = np.inf
    for taus_s, slow in zip(noise.taus_s, noise.slow, strict=True):
        if slow > 0:
            correlation = np.mean([np.exp(-apart_s / tau_s) for tau_s in taus_s], axis=0)
            freedom = min(freedom, len(time_s) ** 2 / float(np.sum(correlation**2)))
    return freedom


# How the estimates of a fit's parameters go together: correlations of what the budget is made of.
#
# The noise of the data correlates them as the fit does; an input that is not fitted, as they follow it together.
# Whoever computes something from several results needs both (GUM 5.2, H.2).


def parameter_correlation(fit: Fit, budget: Budget, inputs: Iterable[Contribution]) -> Array:
    """Shape (p, p), 1 on the diagonal, for the `budget` of `fit`; NaN where a parameter is not determined."""
    cautious = fit.in_all_noise()
    G = row_gains(cautious)
    by_noise, _ = covariance(cautious.information, fit.problem.layout.typical)
    type_a_std = np.sqrt(
        sum((line.std**2 for line in budget.given if line.kind == "A" and line.std is not None), np.zeros(1))
    )
    joint = correlation_matrix(by_noise) * np.outer(type_a_std, type_a_std)
    for c in inputs:
        if c.std:
            by_error = input_effects(fit, G, c)
            joint = joint + c.std**2 * by_error.T @ by_error
    return correlation_matrix(joint)
