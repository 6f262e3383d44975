"""Which noise process is a model missing on a still record? The verdicts are those of `answer`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calibrations.effect import Effect, catalogue
from calibrations.experiment import Experiment
from calibrations.model import Model
from calibrations.still.answer import alternatives, answer
from calibrations.still.chance import chance, tube
from calibrations.still.fit import NoiseFit, fit
from calibrations.still.held_out import held_out_excess
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
    cleaned: NoiseFit  # the same model on the record less what no noise is: what the candidates are set beside
    verdict: str
    candidates: tuple[Candidate, ...]
    held_out_before: float
    missing: tuple[str, ...]  # in the order in which each gains most beside those before it
    alternatives: Mapping[str, tuple[str, ...]]
    reason: str | None  # why it is not decided, in words
    residual_structure: str | None
    next_experiment: Experiment | None
    search: Search

    @cached_property
    def end(self) -> NoiseFit:
        """The model with them."""
        return self.search.end


def diagnose(still: Still, model: Model, effects: Mapping[str, Effect] | None = None) -> Diagnosis:
    """Fit `model` to the record and find what it misses. Raises ModelError for a model without noise."""
    before = fit(model, still)
    found = search(still, before.model, catalogue() if effects is None else effects)
    told = answer(found, before)
    cleaned = fit(before.model, found.still) if found.patterns else before
    return Diagnosis(
        fit=before,
        cleaned=cleaned,
        verdict=told.verdict,
        candidates=_candidates(found, cleaned, alternatives(found, tuple(found.gains))),
        held_out_before=held_out_excess(cleaned.model, found.still),
        missing=told.missing,
        alternatives=told.alternatives,
        reason=told.reason,
        residual_structure=told.structure,
        next_experiment=told.next_experiment,
        search=found,
    )


def _candidates(found: Search, before: NoiseFit, doubts: Mapping[str, tuple[str, ...]]) -> tuple[Candidate, ...]:
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
            doubts.get(effect.name, ()),
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
