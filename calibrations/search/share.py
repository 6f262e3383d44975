"""How much of the error an explanation leaves, and what that means."""

from __future__ import annotations

from calibrations.fit import Fit

MATERIAL = 1.15  # times the noise floor: a residual below is as good as noise
MOST_NOISE = 2.5  # times the noise floor: more than white and slow noise of a sensor alone
MOST_LEFT = 1 / 5  # of the excess variance: more left than this, and the catalogue has not explained it
OF_FORM = 1 / 16  # of it: so little may be the form of the causes, known only approximately


def share_left(start: Fit, present: Fit) -> float:
    """Part of the excess variance at the start that the present fit has not explained."""
    return max(present.pooled_excess**2 - 1, 0.0) / max(start.pooled_excess**2 - 1, 1e-9)
