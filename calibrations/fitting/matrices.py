"""A three-axis calibration as matrices, in the form that navigation uses.

    G_c = M (S G_r + b)            Book (17.3)

    G_r   raw output, in its unit         G_c   specific force in g, field relative to its strength, or deg/s
    S     diagonal, 1 / scale factor      b     -bias / scale factor
    M     the inverse of the sensing axes: misalignment, non-orthogonality, soft iron

The matrices hold the linear effects of a model only. Uncertainties by first-order propagation of the parameters'
covariance (GUM 5.2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.fitting.fit import Fit
from calibrations.fitting.identifiability import covariance
from calibrations.model.chain import respond, sensed
from calibrations.table import Array

LINEAR_EFFECTS = {
    "bias", "scale-factor", "axis-misalignment", "axis-nonorthogonality",
    "field-strength", "hard-iron", "soft-iron",
    "gyro-bias", "gyro-scale-factor", "gyro-misalignment",
}  # fmt: skip
STEP = 1e-4  # of a parameter's typical size


@dataclass(frozen=True)
class CalibrationMatrices:
    """M (3, 3), the diagonal of S (3,), and b (3,), with standard uncertainties; NaN where not determined.

    `beyond`: effects of the model that are not linear and not included.
    """

    M: Array
    S: Array
    b: Array
    M_std: Array
    S_std: Array
    b_std: Array
    unit: str
    beyond: tuple[str, ...]

    def __call__(self, raw: Array) -> Array:
        """Calibrated from raw outputs, both of shape (n, 3)."""
        return np.asarray((raw * self.S + self.b) @ self.M.T)


def calibration_matrices(fit: Fit) -> CalibrationMatrices | None:
    """The matrices of a fitted model; None without three axes, and for a motion."""
    if len(fit.table.axes) < 3 or fit.table.type.moving:
        return None
    M, S, b = _parts(_stack(fit, fit.theta))
    if not np.isfinite(M).all() or not np.isfinite(S).all():
        return None
    typical = STEP * fit.problem.layout.typical
    forward, backward = ([_stack(fit, fit.theta + side * step) for step in np.diag(typical)] for side in (1, -1))
    slopes = (np.array(forward) - np.array(backward)) / (2 * typical[:, None])
    deviations = _parts(_deviation(slopes, _covariance(fit)))
    nonlinear_effects = tuple(name for name in fit.model.effects if name not in LINEAR_EFFECTS)
    return CalibrationMatrices(M, S, b, *deviations, fit.table.input_unit, nonlinear_effects)


def _stack(fit: Fit, theta: Array) -> Array:
    """M, S and b of the linear effects with the values `theta`, one after another, shape (15,)."""
    steps = [step for step in fit.problem.layout.steps(theta) if step[0].name in LINEAR_EFFECTS]
    axes = sensed(np.eye(3), fit.table, steps).T
    zero = respond(np.zeros((1, 3)), fit.table, steps)[0]
    scale = np.diag(respond(np.eye(3), fit.table, steps) - zero)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.concatenate([np.linalg.inv(axes).ravel(), 1 / scale, -zero / scale]) + 0.0  # no negative zero


def _parts(stacked: Array) -> tuple[Array, Array, Array]:
    return stacked[:9].reshape(3, 3), stacked[9:12], stacked[12:]


def _covariance(fit: Fit) -> Array:
    """Covariance of the parameters with the standard uncertainties that the model states; NaN where it has none."""
    cautious = fit.in_all_noise()
    cov, _ = covariance(cautious.information, fit.problem.layout.typical)
    std = np.array([np.nan if e.std is None else e.std for e in fit.params.values()])
    size = np.sqrt(np.diag(cov))
    ratio = std / np.where(size > 0, size, 1.0)
    return np.asarray(cov * np.outer(ratio, ratio))


def _deviation(slopes: Array, cov: Array) -> Array:
    """Standard deviations (k,) of quantities with the derivatives `slopes` (p, k); NaN only if one depends on a NaN."""
    finite = np.isfinite(np.diag(cov))
    variance = np.einsum("pk,pq,qk->k", slopes[finite], cov[np.ix_(finite, finite)], slopes[finite])
    return np.where(slopes[~finite].any(axis=0), np.nan, np.sqrt(np.maximum(variance, 0.0)))
