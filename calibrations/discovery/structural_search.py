"""The end of a search for places: its steps, the places that act, and their causes with the alternatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from calibrations.discovery.additions import Addition, causes_alone, fit_each_axis
from calibrations.discovery.candidates import RowCandidate, candidates, with_planned, with_rivals
from calibrations.discovery.findings import Step
from calibrations.effects import Effect
from calibrations.fitting.fit import Fit
from calibrations.free_forms.acting_places import ActingPlace
from calibrations.free_forms.naming import NAMED_ALONE
from calibrations.free_forms.place_names import PREFIX
from calibrations.progress import report


@dataclass(frozen=True)
class StructuralSearch:
    """The end of a search: the given model, the steps beyond it, and the places that act.

    `named`: effects of the catalogue that are causes; `rivals`: by cause, what the data cannot separate from it.
    `candidates`: every effect of the catalogue alone on top of the given model.
    `causes_alone`: the last model without its free forms.
    """

    start: Fit
    steps: tuple[Step[Fit], ...]
    candidates: tuple[RowCandidate, ...]
    causes_alone: Fit
    places: tuple[ActingPlace, ...] = ()
    named: tuple[str, ...] = ()
    rivals: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    @classmethod
    def of_fits(
        cls,
        start: Fit,
        freed: list[str],
        added: list[Addition],
        fits: list[Fit],
        effects: Mapping[str, Effect],
        ranked: Sequence[RowCandidate] = (),
    ) -> StructuralSearch:
        """The search whose steps are the effects `freed`, up to the first of the `fits`, and then the additions.

        `ranked`: the candidates on `start`, if they are known.
        """
        floor = fits[-1].noise.scatter
        start, fits = start.in_floor(floor), [fitted.in_floor(floor) for fitted in fits]
        steps = _steps(start, freed, fits[0], effects)
        steps += [Step(a.effect.name, *pair) for a, pair in zip(added, pairwise(fits), strict=True)]
        if not ranked:
            report("testing each effect alone")
            ranked = candidates(start, effects)
        ranked = _first(start, steps, ranked)
        forms = [a for a in added if a.effect.name.startswith(PREFIX)]
        return cls(start, tuple(steps), ranked, causes_alone(fits[-1], forms))

    @property
    def end(self) -> Fit:
        """The last fit."""
        return self.steps[-1].after if self.steps else self.start

    @property
    def causes(self) -> tuple[str, ...]:
        """Effects of the steps that are causes."""
        names = {step.name for step in self.steps}
        return tuple(cause for cause in self.named if cause in names)

    @property
    def alternatives(self) -> dict[str, tuple[str, ...]]:
        """By cause, the effects that the data cannot separate from it."""
        rivals_by_cause = {name: self.rivals.get(name, ()) for name in self.causes}
        of_other_form = {cause for place in self.places if place.share < NAMED_ALONE for cause in place.causes}
        if self.candidates and self.causes == (self.candidates[0].name,) and not of_other_form & set(self.causes):
            name, rivals_alone = self.candidates[0].name, self.candidates[0].indistinguishable_from
            rivals_by_cause[name] = tuple(dict.fromkeys([*rivals_by_cause[name], *rivals_alone]))
        return {name: rivals for name, rivals in rivals_by_cause.items() if rivals}


def _steps(start: Fit, names: list[str], base: Fit, effects: Mapping[str, Effect]) -> list[Step[Fit]]:
    """A step for each effect that was freed; the last ends at `base`."""
    fits = [start, *(fit_each_axis(start, names[: k + 1], effects) for k in range(len(names) - 1)), base]
    return [Step(name, *pair) for name, pair in zip(names, pairwise(fits[: len(names) + 1]), strict=True)]


def _first(start: Fit, steps: list[Step[Fit]], ranked: Sequence[RowCandidate]) -> tuple[RowCandidate, ...]:
    """The candidates on the given model, those of the steps first, the first one with the errors of its full fit.

    A single cause has the rivals of the search that adds effects; several causes have none here.
    """
    if not steps:
        return tuple(ranked)
    first_effect, *other_candidates = with_planned(ranked, steps)
    single = sum(not step.name.startswith(PREFIX) for step in steps) == 1
    if single and not first_effect.name.startswith(PREFIX):
        first_effect = with_rivals(first_effect, ranked, start)
    return first_effect, *other_candidates
