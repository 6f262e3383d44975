"""A pattern that describes what a model misses better than every effect found: then its cause is not in the catalogue.

A step in time looks like a drift to a catalogue that knows no step, and a search that has only effects to choose from
takes the nearest. Patterns name no cause, but they compete.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calibrations.fit import Fit
from calibrations.path import Path
from calibrations.patterns import Pattern, patterns
from calibrations.screen import Screen

MARGIN = 10.0  # of twice the log-likelihood, beyond the price of parameters: odds of 150 to 1


def plainer(path: Path) -> str | None:
    """The pattern that explains what the path's first model misses better than the effects of the path, in words.

    Both are compared by likelihood under the noise without its slow part, which would take up either; a parameter
    costs log(rows), and so does the choice among the patterns. In a motion, whose rows repeat each other, a step at the
    beginning is an effect that is always there: nothing competes.
    """
    if not path.steps or path.start.table.kind == "motion":
        return None
    start = replace(path.start, noise=replace(path.start.noise, ratio=np.zeros_like(path.start.noise.ratio)))
    screen = Screen(start)
    tried = [(p, screen.basis(p.columns)) for p in patterns(start.table, start.channels)]
    left = float(screen.residual @ screen.residual)
    worth = [_worth(left - screen.statistic(basis), basis.shape[1] + 1, start) for _, basis in tried]
    if not tried or not max(worth) > _by_effects(path, start) + MARGIN:
        return None
    best: Pattern = tried[int(np.argmax(worth))][0]
    return best.text


def _by_effects(path: Path, start: Fit) -> float:
    white = start.noise.whiten(path.end.residual[:, :, None])[:, 0]
    return _worth(float(white @ white), len(path.end.theta) - len(path.start.theta), start)


def _worth(squares: float, parameters: int, start: Fit) -> float:
    """Twice the log-likelihood less the price of the parameters, up to a constant."""
    rows = start.residual.size
    return -rows * float(np.log(max(squares, 1e-300) / rows)) - parameters * float(np.log(rows))
