"""How much planned poses would tell about a model's parameters: Fisher's information, to first order.

    M = J' Sigma^-1 J        J the model's derivatives at the fitted values, Sigma the noise foreseen

Rows of Sigma^(-1/2) J of independent data stand one below the other: the information of both is their sum.

Source  Fedorov, Theory of Optimal Experiments (1972); Atkinson, Donev and Tobias, Optimum Experimental Designs, with
        SAS (2007), ch. 9 to 11; Pronzato, Automatica 44 (2008), 303-325, on effects that are not linear.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calibrations.fit import Fit
from calibrations.noise import Noise, rms
from calibrations.problem import Problem
from calibrations.search.identify import RELATIVE_RANK, UNDETERMINED
from calibrations.table import Array, Table


def information(fit: Fit, table: Table) -> Array:
    """Derivatives of the model at the fitted values on another `table`, made white, shape (axes * n, parameters).

    A block of rows for each axis, in order of time; a row is in units of its own noise, a column in 1 over the
    parameter's unit. White noise is that of the table's means, scatter that of the fit. Slow noise too is as the fit
    found it: correlated over the table's own times or, where it has none, added as if each row had its own.
    """
    problem = Problem(table.rows(table.order), fit.problem.layout)
    return np.asarray(_noise(fit, problem).whiten(problem.jacobian(fit.theta)))


def covariance_of(rows: Array) -> Array:
    """Covariance of the parameters that `rows` (rows, parameters) determine, shape (parameters, parameters).

    Infinite on the diagonal for a parameter that they leave undetermined.
    """
    p = rows.shape[1]
    size = np.linalg.norm(rows, axis=0)
    scale = np.where(size > 0, size, 1.0)
    _, s, Vt = np.linalg.svd(np.vstack([rows / scale, np.zeros((p, p))]), full_matrices=False)
    good = s > RELATIVE_RANK * s[0]
    root = Vt[good].T / s[good] / scale[:, None]
    covariance = root @ root.T
    free = np.sum(Vt[~good] ** 2, axis=0) > UNDETERMINED
    covariance[free, free] = np.inf
    return np.asarray(covariance)


def noise_on(noise: Noise, problem: Problem) -> Noise:
    """The noise found on some rows, on those of another problem: white as their means have it, the rest as found."""
    white = np.zeros((len(problem.channels), problem.table.n)) if problem.white is None else problem.white
    there = replace(noise, white=white, gap_s=problem.gap_s)
    return replace(there, ratio=noise.slow / rms(there.fast))


def _noise(fit: Fit, problem: Problem) -> Noise:
    """The fit's noise on the rows of another problem; with times, it flickers on as for the fit's own uncertainties."""
    found = fit.noise.prolonged() if "t_s" in problem.table else fit.noise
    if "t_s" not in problem.table:
        found = replace(found, scatter=np.hypot(found.scatter, found.slow), ratio=0 * found.ratio)
    return noise_on(found, problem)
