"""Standard uncertainties beyond white noise: by slow noise, by few rows, and by free forms over time.

Slow noise. The noise of the rows is estimated once more without setting smooth columns aside, and the uncertainties are
averaged over all slow noise that the rows allow (`noise_fit.widening`). Motion has too few rows for that: the factor is
that of Student's t instead.

Slow noise of outputs whose magnitude alone is fitted. Slow noise of an output enters the magnitude in proportion to
that output. So the residuals of two positions are correlated by the product of their directions: slow noise looks like
scatter, and still is a bias. The covariance of the residual under slow noise of each output is

    K = s^2 (W + rho^2 w^2 (D D^T) o C)

W   white noise of the magnitudes; w^2 its mean over the mean square of D, the white variance of an output
D   derivatives of the residual by the outputs, shape (n, axes); o the product by elements
C   correlation of the slow noise from time to time; rho slow noise over white; s found by the residual

The variance of each parameter is the mean over all possible slow noise, weighted by its restricted likelihood.

Free forms over time. A curve of unknown form over the time of one record has a mean over that record, which no data can
separate from the bias. The curve has no mean by its definition, so that the bias takes it. Another record of the same
sensor has another mean: the bias is known no better than the curve varies, as with flicker noise that continues beyond
the record (`Noise.prolonged`). The same holds for the scale factor where it drifts.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from calibrations.fitting.identifiability import covariance, gain
from calibrations.fitting.noise_fit import NO_SLOW, estimate, possible_slow_noise, widening
from calibrations.fitting.solution import Solution
from calibrations.free_forms.place_names import PREFIX
from calibrations.means.noise import Noise
from calibrations.table import Array

MOST_ROWS = 200  # of positions: more rows are thinned evenly
LEAST_FREEDOM = 3.0  # degrees: below, Student's t has no variance
LEVELS = {  # the parameters that the mean of a curve belongs to, by its place
    f"{PREFIX}time-bias": ("bias",),
    f"{PREFIX}time-scale": ("scale-factor", "common-scale"),
}


def estimate_all_noise(solution: Solution) -> Noise:
    """All the noise that the residual shows, from which standard uncertainties are computed.

    Here nothing is set aside: where inclinations follow each other in time, smooth functions of the angles explain slow
    noise as well, and parameters would look more certain than they are.
    """
    nothing = np.zeros((solution.table.n, 0))
    return estimate(solution.noise, solution.residual, solution.free_jacobian, nothing).prolonged()


def uncertainty_factors(solution: Solution) -> Array:
    """Factor on each standard uncertainty by white noise, shape (p,), for a solution in all its noise."""
    by_noise = _factors_by_noise(solution) if solution.problem.averages else _student_factors(solution)
    if not any(term.name.startswith(PREFIX) for term in solution.problem.layout.model.terms):
        return by_noise
    return by_noise * _factors_by_curves(solution, by_noise)


def _factors_by_noise(solution: Solution) -> Array:
    """Factors by the slow noise that the rows allow."""
    problem, free = solution.problem, solution.problem.layout.free
    jacobian, typical = solution.free_jacobian, problem.layout.typical[free]
    factors = np.ones(len(solution.theta))
    if problem.table.type.magnitude:
        axes = problem.table.outputs.shape[1]
        identity = np.broadcast_to(np.eye(axes), (problem.table.n, axes, axes))
        by_output = problem.of_output(solution.theta, identity)
        factors[free] = _factors_by_magnitudes(solution.noise, solution.residual, jacobian, by_output, typical)
    else:
        factors[free] = widening(solution.noise, solution.residual, jacobian, typical)
    return factors


def _factors_by_magnitudes(noise: Noise, residual: Array, jacobian: Array, by_output: Array, typical: Array) -> Array:
    """Factors by slow noise of outputs whose magnitude alone is fitted, shape (p,).

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
    # all rows have less white variance than the thinned ones and the same slow variance: the excess grows by the stride
    ratio = 1 + stride * (mean / np.where(white_variance > 0, white_variance, np.inf) - 1)
    return np.sqrt(np.where((white_variance > 0) & (ratio > 0), ratio, 1.0))


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


def _student_factors(solution: Solution) -> Array:
    """Factors by the number of rows: the standard deviation of Student's t distribution.

    The degrees of freedom of a parameter are those of its channels' noise, weighted by the information of each channel.
    """
    if solution.noise.given:
        return np.ones(len(solution.theta))
    informed = np.sum(solution.whitened[:, 1:].reshape(*solution.residual.shape, -1) ** 2, axis=1)
    total = informed.sum(axis=0)
    weighted_rows = solution.noise.effective_rows @ informed / np.where(total > 0, total, 1.0)
    rows = np.where(total > 0, weighted_rows, solution.residual.shape[1])
    freedom = np.maximum(rows - 1, LEAST_FREEDOM)
    return np.asarray(np.sqrt(freedom / (freedom - 2)))


def _factors_by_curves(solution: Solution, by_noise: Array) -> Array:
    """Factors by free forms over time, shape (p,), in addition to the factors `by_noise` (p,).

    The variance of a bias grows by the mean square of its axis's curve over the rows. That of a scale factor grows by
    the mean square of its curve over that of its column.
    """
    layout = solution.problem.layout
    slots, terms = layout.slots, layout.model.terms
    variance = by_noise**2 * np.diag(covariance(solution.information, layout.typical)[0])
    factors = np.ones(len(slots))
    for place, levels in LEVELS.items():
        for k, slot in enumerate(slots):
            if terms[slot.term].name not in levels or not variance[k] > 0:
                continue
            of_curve = [terms[s.term].name == place and s.axis in (slot.axis, "") for s in slots]
            if any(of_curve):
                curve = solution.residual - solution.problem.residual(np.where(of_curve, 0.0, solution.theta))
                size = float(np.sum(curve**2) / np.sum(solution.jacobian[:, :, k] ** 2))
                factors[k] = np.sqrt(1 + size / variance[k])
    return factors
