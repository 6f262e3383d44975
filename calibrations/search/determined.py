"""Whether the data determine a model at all: a residual as small as noise proves nothing where they do not.

With leverages h (the diagonal of the hat matrix of the whitened jacobian), the error on a row that the fit has not seen
has a variance 1 / (1 - h) times that of noise. Where it is more than twice on average, unseen rows are predicted worse
by the uncertainty of the parameters than by all noise, and the model cannot be called adequate on this data.

Source  leave-one-out prediction variance of linear least squares; Hoaglin and Welsch (1978), the hat matrix.
"""

from __future__ import annotations

import numpy as np

from calibrations.coverage import uncovered
from calibrations.fit import Fit

MOST_UNCERTAIN = 2.0  # variance on an unseen row over that of noise: parameters count for as much as noise


def unseen_variance(found: Fit) -> float:
    """Mean variance of the error on an unseen row over that of noise; 1 where parameters are known exactly."""
    jacobian = found.whitened[:, 1:]
    size = np.linalg.norm(jacobian, axis=0)
    columns = jacobian[:, size > 0] / size[size > 0]
    basis, singular, _ = np.linalg.svd(columns, full_matrices=False)
    leverage = np.sum(basis[:, singular > 1e-8 * singular[0]] ** 2, axis=1) if singular.size else np.zeros(1)
    return float(np.mean(1 / np.maximum(1 - leverage, 1e-12)))


def undetermined(found: Fit) -> str | None:
    """Why a small residual is no proof on this data, in words; None where the data determine the model."""
    if why := uncovered(found.table):
        return why
    variance = unseen_variance(found)
    if variance <= MOST_UNCERTAIN:
        return None
    rows = "positions" if found.table.kind == "positions" else "rows"
    times = f"{np.sqrt(variance):.1f}" if variance < 1e4 else "many"
    return (
        f"the {len(found.theta)} parameters are not identifiable from these {rows}: {found.table.n} of them, and an "
        f"unseen one is predicted {times} times worse than noise alone would make it; measure at more orientations"
    )
