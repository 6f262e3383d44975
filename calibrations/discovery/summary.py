"""The summary of a discovery: one line for each place that acts, and one for each further effect that was added.

Shares are those of the variance beyond the noise. A step's share is the fall of the error on unseen data; the share of
a line is its part of the squares of all lines.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

import numpy as np

from calibrations.criteria import SIGNIFICANT
from calibrations.discovery.findings import Candidate
from calibrations.discovery.results import Discovery
from calibrations.discovery.search import first_order_cost
from calibrations.discovery.significance import chance
from calibrations.fitting.fit import Fit, in_milli, milli_unit, pool_in_milli
from calibrations.free_forms.place_names import PREFIX, place_of_effect
from calibrations.means.noise import rms
from calibrations.table import Array

UNKNOWN = "unknown form"
NO_VARIANCE = 0.1  # of the noise's: with less excess variance there are no shares


@dataclass(frozen=True)
class SummaryRow:
    """One cause. `size`: rms in thousandths of the sensed unit; `certainty`: 1 minus the chance of it by noise alone.

    The certainty is that of the effect or of the added effects that the data cannot separate from it.
    `effects`: those named as causes, () if the form is unknown. `possible`: effects of the model that describe the
    place and are not named, as the data do not show enough of them. `in_another_form`: a free form describes the rest.
    """

    place: str
    effects: tuple[str, ...]
    possible: tuple[str, ...]
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
        named = f"{names} (another form)" if self.in_another_form else names
        return f"{named}, perhaps {' or '.join(self.possible)}" if self.possible else named


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


def summary_lines(discovery: Discovery[Fit]) -> list[SummaryRow]:
    """The lines, largest first."""
    if not discovery.steps:
        return []  # an output that does not respond has no scale
    lines, listed = _place_lines(discovery)
    lines += _further_lines(discovery, listed)
    total = sum(line.size**2 for line in lines) or 1.0
    return sorted((replace(line, share=line.size**2 / total) for line in lines), key=lambda line: -line.size)


def _place_lines(discovery: Discovery[Fit]) -> tuple[list[SummaryRow], set[str]]:
    """A line for each place that acts, without its share, and the effects that these lines list."""
    end, alternatives = discovery.end, discovery.alternatives
    floor, unit = pool_in_milli(end)[1], milli_unit(end)
    added_effects = {step.name for step in discovery.steps}
    lines, listed = list[SummaryRow](), set[str]()
    for place in discovery.findings.places:
        in_model = [c for c in place.causes if c in added_effects]
        free_form = f"{PREFIX}{place.name}"
        if not in_model and free_form not in added_effects:
            continue  # an effect with another name explains it, or the search stopped before
        effects = tuple(c for c in in_model if c in discovery.causes)
        possible = tuple(c for c in in_model if c not in discovery.causes)
        rivals = dict.fromkeys([*place.inseparable_from, *(r for e in effects for r in alternatives.get(e, ()))])
        in_another_form = bool(effects) and free_form in added_effects
        size, certainty = place.size * floor, 1 - place.p_value
        lines.append(
            SummaryRow(place.name, effects, possible, size, unit, 0.0, certainty, tuple(rivals), in_another_form)
        )
        listed |= {*in_model, free_form}
    return lines, listed


def _further_lines(discovery: Discovery[Fit], listed: Collection[str]) -> Iterator[SummaryRow]:
    """A line for each further step, without its share; none for an effect that refines the form of a cause."""
    end, unit = discovery.end, milli_unit(discovery.end)
    added_effects = {step.name for step in discovery.steps}
    for step in discovery.steps:
        if step.name in listed or (step.name in discovery.refinements and not step.name.startswith(PREFIX)):
            continue
        change = rms(in_milli_rows(step.after.residual - step.before.residual, end))
        size = float(np.sqrt(np.mean(change**2)))
        inseparable = tuple(discovery.alternatives.get(step.name, ()))
        certainty = 1 - chance(*first_order_cost(end, step.name, *added_effects.intersection(inseparable)))
        effects = () if step.name.startswith(PREFIX) else (step.name,)
        place_name = place_of_effect(step.name) or "-"
        in_another_form = bool(effects) and f"{PREFIX}{place_name}" in added_effects
        yield SummaryRow(place_name, effects, (), size, unit, 0.0, certainty, inseparable, in_another_form)


def in_milli_rows(values: Array, fit: Fit) -> Array:
    """Residuals (channels, n) in thousandths of the sensed unit."""
    return np.asarray(in_milli(values.T, fit).T)


def certainty_of(c: Candidate) -> str:
    """The certainty that an effect is missing: 1 minus its p-value; a candidate that is not significant has none."""
    return certainty_text(1 - c.p_value) if c.p_value < SIGNIFICANT else "not significant"


def probability_text(c: Candidate) -> str:
    """The probability of a candidate among all: never 0 or 100 %; "" for a candidate that is not significant."""
    if c.p_value >= SIGNIFICANT:
        return ""
    percent = 100 * c.probability
    return "> 99.9 %" if percent > 99.9 else "< 0.1 %" if percent < 0.1 else f"{percent:.3g} %"


def certainty_text(certainty: float) -> str:
    """A certainty in words: never 100 %."""
    return "> 99.99 %" if certainty > 0.9999 else f"{100 * certainty:.4g} %"
