"""How the estimates of a fit's parameters go together: correlations of what the budget is made of.

The noise of the data correlates them as the fit does; an input that is not fitted, as they follow it together. Whoever
computes something from several results needs both (GUM 5.2, H.2).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from calibrations.budget import Budget, followed, gains
from calibrations.fit import Fit, cautiously
from calibrations.inputs import Contribution
from calibrations.search.identify import covariance
from calibrations.table import Array


def correlation(found: Fit, drawn: Budget, inputs: Iterable[Contribution]) -> Array:
    """Shape (p, p), 1 on the diagonal, for the budget `drawn` of `found`; NaN where a parameter is not determined."""
    cautious = cautiously(found)
    G = gains(cautious)
    by_noise, _ = covariance(cautious.whitened[:, 1:], found.problem.layout.typical)
    own = np.sqrt(sum((line.std**2 for line in drawn.given if line.kind == "A" and line.std is not None), np.zeros(1)))
    joint = _normalised(by_noise) * np.outer(own, own)
    for c in inputs:
        if c.std:
            each = followed(found, G, c)
            joint = joint + c.std**2 * each.T @ each
    return _normalised(joint)


def _normalised(covariance: Array) -> Array:
    std = np.sqrt(np.diag(covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(covariance / np.outer(std, std))
