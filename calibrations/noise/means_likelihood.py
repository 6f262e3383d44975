"""The likelihood of a fitted model, with the noise that its own residual shows."""

from __future__ import annotations

import numpy as np

from calibrations.fit import Fit
from calibrations.noise.means_fit import deviance


def twice_log_likelihood(fit: Fit) -> float:
    """Restricted, up to a constant of the data."""
    return -deviance(fit.noise, fit.residual, fit.jacobian, np.zeros((fit.table.n, 0)))


def likelihood(fit: Fit) -> float:
    """The same, a parameter costing log(rows) (Schwarz)."""
    return twice_log_likelihood(fit) - len(fit.theta) * float(np.log(fit.residual.size))
