"""Add the noise processes that a model misses, until none is missing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from calibrations.effect import Effect, catalogue
from calibrations.experiment import Experiment
from calibrations.model import Model
from calibrations.search.share import MOST_LEFT
from calibrations.still.diagnose import share_left, structure_of
from calibrations.still.experiment import separating
from calibrations.still.fit import NoiseFit, fit
from calibrations.still.held_out import held_out_excess
from calibrations.still.record import Still
from calibrations.still.search import Search, search


@dataclass(frozen=True)
class Added:
    """One effect added: the fits without and with it."""

    name: str
    before: NoiseFit
    after: NoiseFit

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
    steps: tuple[Added, ...]
    verdict: str
    alternatives: Mapping[str, tuple[str, ...]]
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
        return self.steps[-1].after if self.steps else self.start


def discover(still: Still, model: Model, effects: Mapping[str, Effect] | None = None) -> Discovery:
    """All effects that `model` misses on the record. Raises ModelError for a model without noise."""
    start = fit(model, still)
    found = search(still, start.model, catalogue() if effects is None else effects)
    return _told(start, found, tuple(_steps(start, found)))


def add(effect: Effect, model: Model, still: Still, effects: Mapping[str, Effect] | None = None) -> Discovery:
    """`model` with one effect more, both fitted to the record. The verdict is on the model with the effect."""
    before = fit(model, still)
    after = fit(before.model.with_effect(effect), still)
    known = catalogue() if effects is None else effects
    rivals = search(still, before.model, known).rivals.get(effect.name, ())
    more = search(still, after.model, {**known, effect.name: effect})
    structure = structure_of(more)
    missing = f"{' and '.join(more.gains)} would explain more" if more.gains else None
    left = missing if structure is None else structure
    return Discovery(
        start=before,
        steps=(Added(effect.name, before, after),),
        verdict="unexplained" if left else "ambiguous" if rivals else "adequate",
        alternatives={effect.name: rivals} if rivals else {},
        residual_structure=left,
        next_experiment=None,
        search=more,
    )


def _steps(start: NoiseFit, found: Search) -> list[Added]:
    """The effects one after another, the last fit being that of the search."""
    steps: list[Added] = []
    present = start
    for name in found.gains:
        last = len(steps) == len(found.gains) - 1
        after = found.end if last else fit(present.model.with_effect(found.effects[name]), found.still)
        steps.append(Added(name, present, after))
        present = after
    return steps


def _told(start: NoiseFit, found: Search, steps: tuple[Added, ...]) -> Discovery:
    structure = structure_of(found)
    if structure is not None and not found.patterns and share_left(start, found.end) > MOST_LEFT:
        return Discovery(start, (), "unexplained", {}, structure, None, found)  # steps that explain little are none
    alternatives = {name: rivals for name, rivals in found.rivals.items() if rivals}
    unexplained = structure is not None and (bool(found.patterns) or not steps)
    verdict = "unexplained" if unexplained else "ambiguous" if structure or alternatives else "adequate"
    return Discovery(
        start=start,
        steps=steps,
        verdict=verdict,
        alternatives=alternatives,
        residual_structure=structure,
        next_experiment=separating(found) if verdict == "ambiguous" and alternatives else None,
        search=found,
    )
