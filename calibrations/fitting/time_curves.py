"""How much less certain a free form over time makes the bias, and the scale factor where it drifts.

A curve of unknown form over the time of one record has a mean over that record, which no data tell from the bias. The
curve has none by its definition, so that the bias takes it. Another record of the same sensor has another mean: the
bias is known no better than the curve varies, as with flicker noise that goes on beyond the record (`prolonged`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from calibrations.fitting.identifiability import covariance
from calibrations.free_forms.place_names import PREFIX
from calibrations.table import Array

if TYPE_CHECKING:
    from calibrations.fitting.fit import Fit

LEVELS = {  # what the mean of a curve at a place belongs to
    f"{PREFIX}time-bias": ("bias",),
    f"{PREFIX}time-scale": ("scale-factor", "common-scale"),
}


def widen_by_curves(fit: Fit, wider: Array) -> Array:
    """Factor on each standard uncertainty, shape (p,), beside the factors `wider` (p,) of noise.

    The variance of a bias grows by the mean square of its axis's curve over the rows. That of a scale factor grows by
    the mean square of its curve over that of its column.
    """
    slots, terms = fit.problem.layout.slots, fit.model.terms
    variance = wider**2 * np.diag(covariance(fit.information, fit.problem.layout.typical)[0])
    factor = np.ones(len(slots))
    for place, levels in LEVELS.items():
        for k, slot in enumerate(slots):
            if terms[slot.term].name not in levels or not variance[k] > 0:
                continue
            of_curve = [terms[s.term].name == place and s.axis in (slot.axis, "") for s in slots]
            if any(of_curve):
                curve = fit.residual - fit.problem.residual(np.where(of_curve, 0.0, fit.theta))
                size = float(np.sum(curve**2) / np.sum(fit.jacobian[:, :, k] ** 2))
                factor[k] = np.sqrt(1 + size / variance[k])
    return factor
