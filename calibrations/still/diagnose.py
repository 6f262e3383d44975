"""Which noise process is a model missing on a still record?

The four answers are those of poses (`calibrations.diagnose`). `effect-missing`: a process, or several, explain what is
left. `ambiguous`: another one does so as well on this record. `unexplained`: what is left is no mixture of processes
and lines: a step, a level that changes, a bump of the spectrum.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calibrations.effect import Effect, catalogue
from calibrations.experiment import Experiment
from calibrations.model import Model
from calibrations.search.share import MOST_LEFT
from calibrations.still.chance import chance, tube
from calibrations.still.experiment import separating
from calibrations.still.fit import NoiseFit, fit
from calibrations.still.held_out import held_out_excess
from calibrations.still.left import left
from calibrations.still.record import Still
from calibrations.still.search import Search, search


@dataclass(frozen=True)
class Candidate:
    """One effect on top of a model. `gain`: twice the gain in log-likelihood; `p_value`: over the whole search."""

    effect: Effect
    after: NoiseFit
    gain: float
    p_value: float
    probability: float
    held_out_after: float
    indistinguishable_from: tuple[str, ...]

    @property
    def name(self) -> str:
        """The effect's name."""
        return self.effect.name


@dataclass(frozen=True)
class Diagnosis:
    """The verdict on a model, the candidates behind it, best first, and what is left with the missing ones."""

    fit: NoiseFit
    verdict: str
    candidates: tuple[Candidate, ...]
    held_out_before: float
    residual_structure: str | None
    next_experiment: Experiment | None
    search: Search

    @property
    def missing(self) -> tuple[str, ...]:
        """All effects that are missed, those that gain most first."""
        return tuple(self.search.gains)

    @cached_property
    def end(self) -> NoiseFit:
        """The model with them."""
        return self.search.end


def diagnose(still: Still, model: Model, effects: Mapping[str, Effect] | None = None) -> Diagnosis:
    """Fit `model` to the record and find what it misses. Raises ModelError for a model without noise."""
    before = fit(model, still)
    found = search(still, before.model, catalogue() if effects is None else effects)
    structure = structure_of(found)
    verdict = _verdict(found, before, structure)
    shown = _candidates(found, before)
    return Diagnosis(
        fit=before,
        verdict=verdict,
        candidates=shown,
        held_out_before=held_out_excess(model, still),
        residual_structure=structure if verdict == "unexplained" else None,
        next_experiment=separating(found) if verdict == "ambiguous" else None,
        search=found,
    )


def structure_of(found: Search) -> str | None:
    """What no effect of the catalogue is, in words: what was taken off the record, and what its best mixture leaves."""
    return "; ".join(pattern.text for pattern in found.patterns) or left(found.end)


def share_left(before: NoiseFit, end: NoiseFit) -> float:
    """Of the excess variance, the share that is left."""
    excess = before.pooled_excess**2 - 1
    return (end.pooled_excess**2 - 1) / excess if excess > 0 else 1.0


def _verdict(found: Search, before: NoiseFit, structure: str | None) -> str:
    if structure is not None and (found.patterns or not found.gains or share_left(before, found.end) > MOST_LEFT):
        return "unexplained"
    if not found.gains:
        return "adequate"
    return "ambiguous" if any(found.rivals.values()) else "effect-missing"


def _candidates(found: Search, before: NoiseFit) -> tuple[Candidate, ...]:
    """Every effect that the model does not hold, each alone on top of it; those that are missed come first."""
    others = [effect for name, effect in found.effects.items() if name not in before.model.effects]
    after = {effect.name: fit(before.model.with_effect(effect), found.still) for effect in others}
    gains = {name: 2 * (each.log_likelihood - before.log_likelihood) for name, each in after.items()}
    if found.liner is not None:
        gains[found.liner.name] = max(gains[found.liner.name], found.gains[found.liner.name])
    bands = sum(len(each.seen) for each in before.channels)
    worth = np.array([_schwarz(effect, gains[effect.name], before, bands) for effect in others])
    odds = np.exp(np.minimum(np.append(worth, 0.0) - max([*worth, 0.0]), 0.0) / 2)
    probability = odds / odds.sum()
    made = [
        Candidate(
            effect, after[effect.name], gains[effect.name], _p_value(effect, gains[effect.name], before, len(others)),
            float(probability[k]), held_out_excess(after[effect.name].model, found.still),
            found.rivals.get(effect.name, ()),
        )
        for k, effect in enumerate(others)
    ]  # fmt: skip
    order = {name: k for k, name in enumerate(found.gains)}
    made.sort(key=lambda c: (order.get(c.name, len(order)), -_schwarz(c.effect, c.gain, before, bands)))
    return tuple(made)


def _schwarz(effect: Effect, gain: float, before: NoiseFit, bands: int) -> float:
    """Gain less the price of the parameters, log(bands) each; of lines, those that it takes for one."""
    count = 2 if effect.lines is not None else len(effect.parameters)
    return gain - len(before.channels) * count * float(np.log(bands))


def _p_value(effect: Effect, gain: float, before: NoiseFit, tried: int) -> float:
    """Chance of such a gain anywhere in the search where nothing is missing."""
    if effect.lines is not None:
        ordinates = sum(each.channel.n / 2 for each in before.channels)
        return float(min(1.0, tried * ordinates * np.exp(-gain / 2)))
    return min(1.0, tried * chance(gain, [tube(each, effect) for each in before.channels]))
