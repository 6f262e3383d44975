"""Rivals of a place: causes at other places that explain what it explains."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from calibrations.free_forms.chain import Coefficients
from calibrations.free_forms.components import Component
from calibrations.free_forms.jumps import STEPS
from calibrations.free_forms.reml import Sizes, gain_of_columns, gains
from calibrations.free_forms.search_result import SearchResult

CLOSE = 10.0  # of -2 log likelihood: the data cannot separate two causes that differ by less
MOSTLY = 0.85  # of a place's gain: a form at a larger place that gains more may be its form


def gain_and_rivals(result: SearchResult, names: Sequence[str], larger: set[str]) -> tuple[float, tuple[str, ...]]:
    """The gain of the place, and causes at other places that explain it as well.

    Of one component those that gain nearly as much. At a `larger` place that acts, also a form that gains most of it:
    the form of a mechanism is never quite that of the catalogue.
    """
    reduced = result.sizes_without(names)
    cost = reduced.deviance - result.sizes.deviance
    acting_components = [result.component(name) for name in names]
    inactive = [
        c for c in result.components if c.name not in result.sizes.variances and c.place != acting_components[0].place
    ]
    limit = cost - acting_components[0].price - CLOSE if len(names) == 1 else np.inf
    most = MOSTLY * cost

    def explains(c: Component, gain: float) -> bool:
        return gain - c.price > (min(limit, most) if c.place in larger and not c.general else limit)

    gained = gains(result.gram, reduced, [c.name for c in inactive])
    close = [c for c in inactive if explains(c, gained[c.name][0])]
    if close:
        gain_beside = _gain_at_state_without(result, reduced, names)
        close = [c for c in close if explains(c, gain_beside(c))]
    return cost, tuple(sorted({c.cause or c.place for c in close} - {c.cause for c in acting_components}))


def _gain_at_state_without(result: SearchResult, reduced: Sizes, names: Sequence[str]) -> Callable[[Component], float]:
    """The gain of a component, with its columns where those of `names` do not act.

    A function of the output, as it is with all components, holds what these add to it: a curve over that output, and
    one over the force that cancels it, would explain them whatever they are.
    """
    acting = {name: values for name, values in result.values.of.items() if name not in names}
    state = result.setting.state_at(Coefficients(result.values.base, acting), result.components)
    gain_of = gain_of_columns(result.gram, reduced, result.columns, result.setting.base_size)

    def gain(c: Component) -> float:
        columns = c.jacobian(state) / result.gram.scales[c.name] / result.white[:, :, None]
        return gain_of(columns.reshape(-1, columns.shape[2]))

    return gain


def replacements_of(result: SearchResult, names: Sequence[str], causes: Sequence[str], cause: str) -> tuple[str, ...]:
    """Catalogue effects of other places whose gain, with the other causes present, is nearly that of `cause` or more.

    Free forms are left out, because with them no form of the catalogue is needed; but not steps, the converter's own.
    """
    acting_components = [result.component(name) for name in names]
    other_causes = {c.name for c in acting_components if c.form is None and c.cause in causes and c.cause != cause}
    reduced = result.sizes_without(name for name in names if name not in other_causes)
    place = acting_components[0].place
    trials = [
        c
        for c in result.components
        if c.cause
        and (c.form is None or c.name == STEPS)
        and not c.noise
        and (c.name in names or c.name not in result.sizes.variances)
        and (c.cause == cause if c.place == place else c.name not in names)
    ]
    gained = gains(result.gram, reduced, [c.name for c in trials])
    net_gains = {c.name: gained[c.name][0] - c.price for c in trials}
    least = max((net_gains[c.name] for c in trials if c.place == place), default=np.inf) - CLOSE
    return tuple({c.cause for c in trials if c.place != place and net_gains[c.name] > least})
