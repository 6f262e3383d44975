"""A pattern that describes what a model misses better than every effect found: then its cause is not in the catalogue.

A step in time looks like a drift to a catalogue that knows no step, and a search that has only effects to choose from
takes the nearest. Patterns name no cause, but they compete.
"""

from __future__ import annotations

import numpy as np

from calibrations.fit import Fit
from calibrations.search.patterns import Pattern, patterns
from calibrations.search.screen import Screen
from calibrations.search.structure import likelihood, sharpened, without_slow, worth

CONTAINED = 0.98  # of the squares of what effects explain; of a random walk fitted to a step, 0.95 is the step's
MARGIN = 10.0  # of twice the log-likelihood, beyond the price of parameters: odds of 150 to 1


def plainer(begin: Fit, end: Fit) -> Pattern | None:
    """The pattern that explains what the model of `begin` misses better than the effects added up to `end`.

    Both are compared by likelihood under the noise without its slow part, which would take up either; a parameter
    costs log(rows), and so does the choice among the patterns. In a motion, whose rows repeat each other, a step at the
    beginning is an effect that is always there: nothing competes.
    """
    if end is begin or begin.table.kind == "motion":
        return None
    start = without_slow(begin)
    screen = Screen(start)
    price = float(np.log(start.residual.size))
    tried = [(worth(p, screen) - price, p) for p in patterns(start.table, start.channels)]
    best, pattern = max(tried, key=lambda each: each[0], default=(-np.inf, None))
    if pattern is None or not best > _by_effects(end, start) + MARGIN or _contains(pattern, begin, end, screen):
        return None
    return sharpened(pattern, screen)


def _contains(pattern: Pattern, begin: Fit, end: Fit, screen: Screen) -> bool:
    """Whether what the effects explain is part of the pattern: it then tells more of their form, and no other cause."""
    explained = screen.freed(begin.residual - end.residual)
    inside = screen.basis(pattern.columns).T @ explained
    return float(inside @ inside) > CONTAINED * float(explained @ explained)


def _by_effects(end: Fit, start: Fit) -> float:
    white = start.noise.whiten(end.residual[:, :, None])[:, 0]
    return likelihood(float(white @ white), len(end.theta) - len(start.theta), start)
