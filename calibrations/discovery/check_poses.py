"""A model judged on poses that its fit has not seen, by noise that repeated poses show: is anything missing?

The rows marked as checks are kept out of the fit. Their errors e have the variance of noise and of the parameters,

    S = W + J C J'        W the white noise of the means, C the covariance of the parameters by the other rows

and e' S^-1 e / m has an F distribution, over the same ratio (pure error over W) for the poses that were measured more
than once. What the repeats show beyond white noise, such as a slow noise, is then no misfit of the model.

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

MARK = "check"  # what the path of a check pose begins with
MANY = 1e9  # degrees of freedom of a noise that is known


@dataclass(frozen=True)
class Check:
    """How well a fit to the other poses predicts the check poses.

    poses       that are predicted
    error       rms of their errors, each in units of the standard deviation foreseen by white noise and parameters
    repeats     poses measured again, by their number
    pure_error  rms of what they differ by, in units of that by white noise; 1 where there are too few
    chance      that noise, as large as the repeats show it, makes errors as large
    again       that white noise makes the repeats differ as much
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


def unseen(model: Model, table: Table) -> Check | None:
    """`model` on the check poses of `table`.

    None where they are too few, where the others do not determine the model, or where the noise is not known.
    """
    marked = np.array([path.startswith(MARK) for path in table.labels.get("path", ())], dtype=bool)
    if not table.type.stage_angles or marked.sum() < FEWEST_CHECKS:
        return None
    try:
        found = fit(model, table.rows(~marked))
    except TooFewRows:
        return None
    if found.problem.white is None:
        return None
    problem = found.problem.on(table.rows(marked))
    errors = _standardised(found, problem)
    squares, freedom = repeated(found)
    known = freedom < FEWEST_CHECKS * len(table.axes)
    pure, ratio = 1.0 if known else squares / freedom, float(np.mean(errors**2))
    return Check(
        poses=problem.table.n,
        error=float(np.sqrt(ratio)),
        repeats=freedom // len(table.axes),
        pure_error=float(np.sqrt(pure)),
        chance=float(fdtrc(len(errors), MANY if known else freedom, ratio / pure)),
        again=1.0 if known else float(chdtrc(freedom, squares)),
    )


def repeated(found: Fit) -> tuple[float, int]:
    """Of poses that were measured more than once: the sum of squares about their means in units of white noise, and
    its degrees of freedom. Residuals are taken, so that what the model knows of time and temperature is off.
    """
    names = [name for name in ("alpha_deg", "beta_deg", "direction", "mount_deg", "flip") if name in found.table]
    angles = np.column_stack([found.table.column(name) for name in names])
    _, group = np.unique(np.round(angles, 6), axis=0, return_inverse=True)
    same = np.eye(int(group.max()) + 1)[group.ravel()]  # (n, groups)
    white = found.residual / _white(found.problem)
    about = white - (white @ same / same.sum(axis=0)) @ same.T
    return float(np.sum(about**2)), len(white) * (found.table.n - same.shape[1])


def _standardised(found: Fit, problem: Problem) -> Array:
    """Errors on the rows of `problem`, each of variance 1 and independent of the others, shape (axes * n,)."""
    own, J = found.jacobian / _white(found.problem)[:, :, None], problem.jacobian(found.theta)
    cov, _ = covariance(own.reshape(-1, own.shape[2]), found.problem.layout.typical)
    flat = J.reshape(-1, J.shape[2])
    S = np.diag(_white(problem).ravel() ** 2) + flat @ cov @ flat.T
    return np.asarray(np.linalg.solve(np.linalg.cholesky(S), problem.residual(found.theta).ravel()))


def _white(problem: Problem) -> Array:
    """Standard deviations of the means, (axes, n). Raises DataError where nothing tells them."""
    if problem.white is None:
        raise DataError(f"{problem.table.source}: the noise of the means is unknown; give the columns vx_std_v and n")
    return problem.white
