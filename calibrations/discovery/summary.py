"""The summary of a discovery: one line for each place that acts, and one for each further effect that was added.

Shares are those of the variance beyond the noise. A step's share is the fall of the error on unseen data; the share of
a line is its part of the squares of all lines.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.discovery.results import Discovery
from calibrations.discovery.search import first_order_cost
from calibrations.discovery.significance import chance
from calibrations.fitting.fit import Fit
from calibrations.fitting.sensed import in_milli, milli_unit, pool_in_milli
from calibrations.free_forms.place_names import PREFIX, place_of_effect
from calibrations.means.noise import rms
from calibrations.table import Array

UNKNOWN = "unknown form"
NO_VARIANCE = 0.1  # of the noise's: with less excess variance there are no shares


@dataclass(frozen=True)
class Line:
    """One cause. `size`: rms in thousandths of the sensed unit; `certainty`: 1 minus the chance of it by noise alone.

    The certainty is that of the effect or of the added effects that the data cannot separate from it.
    `effects`: () if the form is unknown. `in_another_form`: a free form describes the remainder of the effects.
    """

    place: str
    effects: tuple[str, ...]
    size: float
    unit: str
    share: float
    certainty: float
    inseparable_from: tuple[str, ...]
    in_another_form: bool = False

    @property
    def effect(self) -> str:
        """The effects in words."""
        names = ", ".join(self.effects) or UNKNOWN
        return f"{names} (another form)" if self.in_another_form else names


def step_shares(discovery: Discovery[Fit]) -> list[float | None]:
    """By step, its share of the variance beyond the noise, on unseen data; below 0 if the error rises.

    None if the residual of the given model is noise.
    """

    def excess_variance(excess: float) -> float:
        return max(float(excess) ** 2 - 1, 0.0)

    total = excess_variance(discovery.start.held_out_excess)
    if total < NO_VARIANCE:
        return [None for _ in discovery.steps]
    return [(excess_variance(s.held_out_before) - excess_variance(s.held_out_after)) / total for s in discovery.steps]


def summary_lines(discovery: Discovery[Fit]) -> list[Line]:
    """The lines, largest first."""
    if not discovery.steps:
        return []  # an output that does not respond has no scale
    findings, end = discovery.findings, discovery.end
    floor, unit = pool_in_milli(end)[1], milli_unit(end)
    added_effects = {step.name for step in discovery.steps}
    alternatives = discovery.alternatives
    lines, listed = [], set[str]()
    for place in findings.places:
        effects = tuple(c for c in place.causes if c in added_effects)
        if not effects and f"{PREFIX}{place.name}" not in added_effects:
            continue  # an effect with another name explains it, or the search stopped before
        rivals = dict.fromkeys([*place.inseparable_from, *(r for e in effects for r in alternatives.get(e, ()))])
        certainty = 1 - place.p_value
        lines.append((place.name, effects, place.size * floor, certainty, tuple(rivals)))
        listed |= {*effects, f"{PREFIX}{place.name}"}
    for step in discovery.steps:
        if step.name in listed or (step.name in discovery.refinements and not step.name.startswith(PREFIX)):
            continue
        change = rms(in_milli_rows(step.after.residual - step.before.residual, end))
        rivals_of_step = tuple(alternatives.get(step.name, ()))
        p = chance(*first_order_cost(end, step.name, *added_effects.intersection(rivals_of_step)))
        effects = () if step.name.startswith(PREFIX) else (step.name,)
        place_name = place_of_effect(step.name) or "-"
        lines.append((place_name, effects, float(np.sqrt(np.mean(change**2))), 1 - p, rivals_of_step))
    total = sum(size**2 for _, _, size, _, _ in lines) or 1.0
    summary = [
        Line(
            place_name,
            e,
            size,
            unit,
            size**2 / total,
            certainty,
            rivals,
            bool(e) and f"{PREFIX}{place_name}" in added_effects,
        )
        for place_name, e, size, certainty, rivals in lines
    ]
    return sorted(summary, key=lambda line: -line.size)


def in_milli_rows(values: Array, fit: Fit) -> Array:
    """Residuals (channels, n) in thousandths of the sensed unit."""
    return np.asarray(in_milli(values.T, fit).T)


def sure(certainty: float) -> str:
    """A certainty in words: never 100 %."""
    return "> 99.99 %" if certainty > 0.9999 else f"{100 * certainty:.4g} %"
