"""Test of a model on check poses, which its fit does not use, against the noise that repeated poses show.

The fit excludes the rows marked as checks. Their errors e have the variance of noise and of the parameters,

    S = W + J C J'        W the white noise of the means, C the covariance of the parameters by the other rows

and e' S^-1 e / m has an F distribution, over the same ratio (pure error over W) for the repeated poses. Noise of the
repeats beyond white noise, such as a slow noise, is then no misfit of the model.

Source  Atkinson, Donev and Tobias, Optimum Experimental Designs, with SAS (2007), on lack of fit and checking points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, fdtrc

from calibrations.criteria import CHECK_SIGNIFICANT, FEWEST_CHECKS
from calibrations.errors import DataError, TooFewRows
from calibrations.fitting.fit import Fit, fit
from calibrations.fitting.identifiability import covariance
from calibrations.fitting.problem import Problem
from calibrations.model import Model
from calibrations.table import Array, Table

MARK = "check"  # prefix of the path of a check pose
KNOWN_FREEDOM = 1e9  # degrees of freedom of a noise that is known


@dataclass(frozen=True)
class Check:
    """Prediction of the check poses by a fit to the other poses.

    poses       number of check poses
    error       rms of their errors in units of the standard deviation by white noise and parameters
    repeats     number of repeated poses
    pure_error  rms of the differences between repeats in units of white noise; 1 if there are too few
    chance      probability that noise of the size that the repeats show makes errors as large
    again       probability that white noise makes the repeats differ as much
    """

    poses: int
    error: float
    repeats: int
    pure_error: float
    chance: float
    again: float

    @property
    def passed(self) -> bool:
        """Whether check poses show nothing more than noise."""
        return self.chance >= CHECK_SIGNIFICANT

    @property
    def steady(self) -> bool:
        """Whether repeats show nothing more than white noise."""
        return self.again >= CHECK_SIGNIFICANT


def judge_check_poses(model: Model, table: Table) -> Check | None:
    """Test of `model` on the check poses of `table`.

    None if they are too few, if the other poses do not determine the model, or if the noise is not known.
    """
    marked = np.array([path.startswith(MARK) for path in table.labels.get("path", ())], dtype=bool)
    if not table.type.stage_angles or marked.sum() < FEWEST_CHECKS or marked.all():
        return None
    try:
        fitted = fit(model, table.rows(~marked))
    except TooFewRows:
        return None
    if fitted.problem.white is None:
        return None
    problem = fitted.problem.on(table.rows(marked))
    errors = _standardise(fitted, problem)
    squares, freedom = compare_repeated_poses(fitted)
    noise_known = freedom < FEWEST_CHECKS * len(table.axes)
    pure, ratio = 1.0 if noise_known else squares / freedom, float(np.mean(errors**2))
    return Check(
        poses=problem.table.n,
        error=float(np.sqrt(ratio)),
        repeats=freedom // len(table.axes),
        pure_error=float(np.sqrt(pure)),
        chance=float(fdtrc(len(errors), KNOWN_FREEDOM if noise_known else freedom, ratio / pure)),
        again=1.0 if noise_known else float(chdtrc(freedom, squares)),
    )


def compare_repeated_poses(fit: Fit) -> tuple[float, int]:
    """Sum of squares of repeated poses about their means in units of white noise, and its degrees of freedom.

    It is that of residuals, without the effects of time and temperature that the model describes.
    """
    names = [name for name in ("alpha_deg", "beta_deg", "direction", "mount_deg", "flip") if name in fit.table]
    angles = np.column_stack([fit.table.column(name) for name in names])
    _, group = np.unique(np.round(angles, 6), axis=0, return_inverse=True)
    group, white = group.ravel(), fit.residual / _white(fit.problem)
    count = np.bincount(group)
    means = np.array([np.bincount(group, channel) / count for channel in white])
    return float(np.sum((white - means[:, group]) ** 2)), len(white) * (fit.table.n - len(count))


def _standardise(fit: Fit, problem: Problem) -> Array:
    """Errors on the rows of `problem`, each of variance 1 and independent of the others, shape (axes * n,)."""
    weighted, J = fit.jacobian / _white(fit.problem)[:, :, None], problem.jacobian(fit.theta)
    cov, _ = covariance(weighted.reshape(-1, weighted.shape[2]), fit.problem.layout.typical)
    flat = J.reshape(-1, J.shape[2])
    S = np.diag(_white(problem).ravel() ** 2) + flat @ cov @ flat.T
    return np.asarray(np.linalg.solve(np.linalg.cholesky(S), problem.residual(fit.theta).ravel()))


def _white(problem: Problem) -> Array:
    """Standard deviations of the means, (axes, n). Raises DataError if they are unknown."""
    if problem.white is None:
        raise DataError(f"{problem.table.source}: the noise of the means is unknown; give the columns vx_std_v and n")
    return problem.white
