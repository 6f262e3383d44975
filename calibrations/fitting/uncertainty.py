"""Standard uncertainties beyond white noise: by slow noise, by few rows, and by free forms over time.

Slow noise. The noise of the rows is estimated once more without setting smooth columns aside, and the uncertainties are
averaged over all slow noise that the rows allow (`noise_fit.widening`, `slow_outputs.widen_by_magnitudes`). Motion has
too few rows for that: Student's t of the estimated noise takes its place.

Free forms over time. A curve of unknown form over the time of one record has a mean over that record, which no data can
separate from the bias. The curve has no mean by its definition, so that the bias takes it. Another record of the same
sensor has another mean: the bias is known no better than the curve varies, as with flicker noise that continues beyond
the record (`Noise.prolonged`). The same holds for the scale factor where it drifts.
"""

from __future__ import annotations

import numpy as np

from calibrations.fitting.identifiability import covariance
from calibrations.fitting.noise_fit import estimate, widening
from calibrations.fitting.slow_outputs import widen_by_magnitudes
from calibrations.fitting.solution import Solution
from calibrations.free_forms.place_names import PREFIX
from calibrations.means.noise import Noise
from calibrations.table import Array

LEAST_FREEDOM = 3.0  # degrees: below, Student's t has no variance
LEVELS = {  # the parameters that the mean of a curve belongs to, by its place
    f"{PREFIX}time-bias": ("bias",),
    f"{PREFIX}time-scale": ("scale-factor", "common-scale"),
}


def estimate_all_noise(solution: Solution) -> Noise:
    """All the noise that the residual shows, from which standard uncertainties are computed.

    Here nothing is set aside: where inclinations follow each other in time, smooth functions of the angles take up slow
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
        factors[free] = widen_by_magnitudes(solution.noise, solution.residual, jacobian, by_output, typical)
    else:
        factors[free] = widening(solution.noise, solution.residual, jacobian, typical)
    return factors


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
