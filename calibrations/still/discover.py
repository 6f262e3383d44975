"""Add the noise processes that a model misses, until none is missing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from calibrations.effect import Effect, catalogue
from calibrations.experiment import Experiment
from calibrations.model import Model
from calibrations.still.answer import alternatives, answer, next_of, reason_of, structure_of
from calibrations.still.fit import NoiseFit, fit
from calibrations.still.held_out import held_out_excess
from calibrations.still.record import Still
from calibrations.still.search import Search, search


@dataclass(frozen=True)
class Added:
    """One effect added: the fits without and with it.

    `gained` in log-likelihood depends on what was added before, and the gains of all steps add up; `alone` is what the
    final model would lose without this one effect.
    """

    name: str
    before: NoiseFit
    after: NoiseFit
    alone: float

    @property
    def gained(self) -> float:
        """In log-likelihood, beside what was added before."""
        return self.after.log_likelihood - self.before.log_likelihood

    @cached_property
    def held_out_before(self) -> float:
        """Pooled excess on unseen halves without it."""
        return held_out_excess(self.before.model, self.before.still)

    @cached_property
    def held_out_after(self) -> float:
        """Pooled excess on unseen halves with it."""
        return held_out_excess(self.after.model, self.after.still)


@dataclass(frozen=True)
class Discovery:
    """What was missing: the effects in the order added, and what this record cannot tell from each."""

    start: NoiseFit
    cleaned: NoiseFit | None  # the same model on the record less what no noise is, where there is some
    steps: tuple[Added, ...]
    verdict: str
    alternatives: Mapping[str, tuple[str, ...]]
    reason: str | None  # why it is not decided, in words
    residual_structure: str | None
    next_experiment: Experiment | None
    search: Search

    @property
    def causes(self) -> tuple[str, ...]:
        """Names of the effects that were missing."""
        return tuple(step.name for step in self.steps)

    @property
    def end(self) -> NoiseFit:
        """The fit of the final model."""
        return self.steps[-1].after if self.steps else self.cleaned or self.start


def discover(still: Still, model: Model, effects: Mapping[str, Effect] | None = None) -> Discovery:
    """All effects that `model` misses on the record. Raises ModelError for a model without noise."""
    start = fit(model, still)
    found = search(still, start.model, catalogue() if effects is None else effects)
    told = answer(found, start)
    cleaned = fit(start.model, found.still) if found.patterns else None
    return Discovery(
        start=start,
        cleaned=cleaned,
        steps=tuple(_steps(cleaned or start, found, told.missing)),
        verdict="adequate" if told.verdict == "effect-missing" else told.verdict,
        alternatives=told.alternatives,
        reason=told.reason,
        residual_structure=told.structure,
        next_experiment=told.next_experiment,
        search=found,
    )


def add(effect: Effect, model: Model, still: Still, effects: Mapping[str, Effect] | None = None) -> Discovery:
    """`model` with one effect more, both fitted to the record. The verdict is on the model with the effect."""
    before = fit(model, still)
    after = fit(before.model.with_effect(effect), still)
    known = catalogue() if effects is None else effects
    first = search(still, before.model, known)
    more = search(still, after.model, {**known, effect.name: effect})
    doubts = alternatives(first, (effect.name,)) if effect.name in first.gains else {}
    structure = structure_of(more)
    missing = f"{' and '.join(more.gains)} would explain more" if more.gains else None
    return Discovery(
        start=before,
        cleaned=None,
        steps=(Added(effect.name, before, after, (after.log_likelihood - before.log_likelihood)),),
        verdict="unexplained" if structure or missing else "ambiguous" if doubts else "adequate",
        alternatives=doubts,
        reason=reason_of(first, doubts, structure) or missing,
        residual_structure=missing if structure is None else structure,
        next_experiment=next_of(first, doubts, structure),
        search=more,
    )


def _steps(start: NoiseFit, found: Search, missing: tuple[str, ...]) -> list[Added]:
    """The effects one after another, the last fit being that of the search."""
    steps: list[Added] = []
    present = start
    for name in missing:
        last = len(steps) == len(found.gains) - 1
        after = found.end if last else fit(present.model.with_effect(found.effects[name]), found.still)
        steps.append(Added(name, present, after, found.gains[name] / 2))
        present = after
    return steps
