"""Effects that the data at hand cannot show, whatever the sensor does.

An effect is shown where at least one of its parameters would be known better than what a sensor may typically have
(`identify.py`), fitted jointly with the model. One inclination, or a turn one way only, hides several.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from calibrations.effect import Effect
from calibrations.fit import Fit
from calibrations.parameters import Layout
from calibrations.problem import Problem
from calibrations.search.identify import UNDETERMINED, covariance
from calibrations.table import Array


def blind_to(found: Fit, effects: Mapping[str, Effect]) -> tuple[str, ...]:
    """The effects, of the model or not, that this table has the columns for and whose parameters it leaves unknown."""
    return tuple(name for name, effect in effects.items() if _hidden(found, effect))


def _hidden(found: Fit, effect: Effect) -> bool:
    if found.table.content in effect.kinds and effect.lacks(found.table) is not None:
        return True
    return _can_be_asked(found, effect) and not _shows(found, effect)


def _can_be_asked(found: Fit, effect: Effect) -> bool:
    """Whether there is a column for all that it needs, and a row for each parameter."""
    if effect.excluded(found.table) is not None:
        return False
    return found.residual.size > len(Layout.of(found.model.with_effect(effect), found.table).slots)


def _shows(found: Fit, effect: Effect) -> bool:
    """Whether a parameter of the effect is determined, from any of its starts."""
    model = found.model if found.model.holds(effect.name) else found.model.with_effect(effect)
    problem = Problem.of(model, found.table)
    mine, typical = problem.layout.of_effect(effect.name), problem.layout.typical
    starts = [found.theta] if model is found.model else problem.layout.starts()
    return any(_determined(found, problem.jacobian(theta), mine, typical) for theta in starts)


def _determined(found: Fit, jacobian: Array, mine: NDArray[np.bool_], typical: Array) -> bool:
    if not np.any(jacobian[:, :, mine]):
        return False
    cov, null = covariance(found.noise.whiten(jacobian), typical)
    std, free = np.sqrt(np.diag(cov)), np.sum(null**2, axis=0)
    return bool(np.any((free[mine] <= UNDETERMINED) & (std[mine] < typical[mine])))
