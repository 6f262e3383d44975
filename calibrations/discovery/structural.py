"""The search for missing effects of poses: first the places that act, then the catalogue effects that are their causes.

Each named cause becomes an effect of the model. What a place shows beyond its causes becomes a free form, and so does
a place without a cause: the error falls, and the cause remains open.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

from calibrations.criteria import MATERIAL, MOST_UNEXPLAINED, SIGNIFICANT
from calibrations.discovery.additions import (
    BASIC,
    NO_WORSE,
    Addition,
    additions,
    at_values_of,
    causes_alone,
    fitted,
    free_additions,
    gradually,
    largest_first,
    separately,
    small_beside_forms,
    together,
)
from calibrations.discovery.candidates import RowCandidate, candidates, with_planned, with_rivals
from calibrations.discovery.findings import Step
from calibrations.discovery.search import first_order
from calibrations.discovery.significance import chance
from calibrations.effects import Effect
from calibrations.fitting.fit import Fit, fit, refit
from calibrations.fitting.problem import Problem
from calibrations.fitting.requested_forms import beyond_base
from calibrations.free_forms.geometry import GEOMETRY, GeometryEffects
from calibrations.free_forms.place_names import PREFIX
from calibrations.free_forms.stairs import before_stairs, find_stairs, fitted_stairs
from calibrations.free_forms.structure import FloorSource, Structure, find_structure, with_stairs
from calibrations.means.noise import with_white
from calibrations.model import Estimate
from calibrations.model.chain import force
from calibrations.table import Array

STAIRS = "quantisation"
NEARLY = 1.5  # noise floors: with more the stairs were not the right ones


@dataclass(frozen=True)
class StructuralSearch:
    """The end of a search: the given model, the steps beyond it, and the places that act.

    `candidates`: every effect of the catalogue alone on top of the given model.
    `causes_alone`: the last model without its free forms.
    """

    start: Fit
    steps: tuple[Step[Fit], ...]
    structure: Structure
    candidates: tuple[RowCandidate, ...]
    causes_alone: Fit
    remarks: tuple[str, ...]

    @property
    def end(self) -> Fit:
        """The last fit."""
        return self.steps[-1].after if self.steps else self.start

    @property
    def causes(self) -> tuple[str, ...]:
        """Effects of the steps that are causes."""
        names = {step.name for step in self.steps}
        return tuple(cause for cause in self.structure.causes if cause in names)

    @property
    def alternatives(self) -> dict[str, tuple[str, ...]]:
        """By cause, what the data cannot separate from it."""
        found = {name: self.structure.alternatives.get(name, ()) for name in self.causes}
        if self.candidates and self.causes == (self.candidates[0].name,):
            name, rivals = self.candidates[0].name, self.candidates[0].indistinguishable_from
            found[name] = tuple(dict.fromkeys([*found[name], *rivals]))
        return {name: others for name, others in found.items() if others}


def search_structure(start: Fit, effects: Mapping[str, Effect]) -> StructuralSearch:
    """The effects and free forms that the model of `start` misses."""
    basic = [name for name in BASIC if name in effects and not start.model.holds(name)]
    base = _freed(start, basic, effects)
    behind, share_left = _behind_stairs(base, effects)
    remarks: tuple[str, ...] = ()
    if behind is not None and (behind.end.held_out_excess <= MATERIAL or share_left < MOST_UNEXPLAINED):
        best = behind
    else:
        found = structure(base, effects)
        if found.floor_source is not FloorSource.SAMPLES and start.noise.known:
            start, base = (fit(f.model, with_white(f.table, found.white)) for f in (start, base))
            remarks = (f"The noise floor is that of the residual: {found.floor_source}.",)
        best = _named_and_fitted(base, found, effects)
        if behind is not None and not remarks and behind.end.held_out_excess < min(best.end.held_out_excess, NEARLY):
            best = behind
    found, causes, forms, end = best.found, best.causes, best.forms, best.end
    needed = [name for name in basic if chance(*first_order(end, name, shared=True)) < SIGNIFICANT]
    chosen = [*largest_first(at_values_of(end, causes), end, found), *at_values_of(end, forms)]
    if needed != basic:
        base = _freed(start, needed, effects)
        end = together(base, chosen)
    taken, fits = gradually(base, chosen, end)
    if fits[-1].pooled_excess < NO_WORSE * end.pooled_excess:
        chosen, end = taken, fits[-1]
        forms = [a for a in chosen if a.effect.name.startswith(PREFIX)]
    else:
        fits = [base, *fitted(base, end, chosen)]
    steps = _steps(start, needed, base, effects)
    steps += [Step(a.effect.name, *pair) for a, pair in zip(chosen, pairwise(fits), strict=True)]
    tried = _first(start, steps, candidates(start, effects))
    return StructuralSearch(start, tuple(steps), found, tried, causes_alone(end, forms), remarks)


@dataclass(frozen=True)
class _Named:
    """A structure, the additions of its causes and of its free forms, and the fit of all of them."""

    found: Structure
    causes: list[Addition]
    forms: list[Addition]
    end: Fit


def _named_and_fitted(base: Fit, found: Structure, effects: Mapping[str, Effect]) -> _Named:
    """Causes and free forms of a structure, fitted; where that leaves more than noise, once more beside the causes."""
    added = additions(found, base.model, effects)
    causes = separately(base, found, added)
    forms = free_additions(found, base.model)
    end = together(base, [*causes, *forms])
    if any(a.effect.rounds for a in added):  # the whole output is rounded, and not what the other places leave
        as_searched = [a if a.effect.rounds else alone for a, alone in zip(added, causes, strict=True)]
        other = together(base, [*as_searched, *forms])
        if other.pooled_excess < end.pooled_excess:
            causes, end = as_searched, other
        smooth = [a for a in causes if not a.effect.rounds]
        other = together(base, [*smooth, *forms])
        if other.pooled_excess < NO_WORSE * end.pooled_excess:  # as well without
            causes, end = smooth, other
    if end.pooled_excess > base.pooled_excess:  # all at once went astray
        taken, fits = gradually(base, [*causes, *forms])
        causes, forms = ([a for a in taken if a.effect.name.startswith(PREFIX) is free] for free in (False, True))
        end = fits[-1]
    if end.held_out_excess > MATERIAL and not end.problem.rounds:
        # forms are found again beside the causes as the catalogue has them, so that they hold what these leave
        beside = structure(causes_alone(end, forms), effects)
        refined = separately(base, beside, additions(beside, end.model, effects))
        others = [*refined, *free_additions(beside, base.model)]
        other = together(base, [*at_values_of(end, causes), *others])
        if other.held_out_excess < end.held_out_excess:
            causes, forms, end = at_values_of(end, causes), others, other
    if end.held_out_excess > MATERIAL and (small := small_beside_forms(at_values_of(end, causes), forms)):
        other = together(base, [*small, *forms])
        if other.held_out_excess < end.held_out_excess:
            causes, end = small, other
    return _Named(found, causes, forms, end)


def _behind_stairs(base: Fit, effects: Mapping[str, Effect]) -> tuple[_Named | None, float]:
    """What acts before a coarse converter, searched for in the outputs before their rounding; None: no stairs show.

    Also the part of the excess variance of the same without the converter that they leave. Noise in front of a coarse
    converter is magnified at the edges of its steps, so that more than the noise floor may be left.
    """
    white = base.problem.white
    if STAIRS not in effects or base.model.holds(STAIRS) or white is None or "output" in base.table.left_out:
        return None, 1.0
    stairs = find_stairs(base.table, base.table.outputs.T - base.residual, white)
    if stairs is None:
        return None, 1.0
    smooth = fit(base.model, before_stairs(base.table, white, stairs))
    found = structure(smooth, effects)
    causes = separately(smooth, found, additions(found, smooth.model, effects))
    forms = free_additions(found, smooth.model)
    stairs = fitted_stairs(base.table, found.result.state.predicted, white, stairs)
    values = {"step": stairs.step, "offset": stairs.offset, "noise": stairs.noise}
    rounding = Addition(
        effects[STAIRS], {}, tuple(Estimate(name, "", value, None, "") for name, value in values.items())
    )
    end, without = (together(base, [*causes, *stage, *forms]) for stage in ([rounding], []))
    if without.pooled_excess < NO_WORSE * end.pooled_excess:
        return None, 1.0  # as well without: a regular sweep gathers outputs by itself
    named = _Named(with_stairs(found, base.residual, stairs, white), [*causes, rounding], forms, end)
    return named, end.share_left(without)


def _freed(start: Fit, names: list[str], effects: Mapping[str, Effect]) -> Fit:
    """The fit in which each axis has a value of its own of these effects."""
    model = start.model
    for name in names:
        model = model.with_effect(effects[name])
    return refit(start, model) if names else start


def _steps(start: Fit, names: list[str], base: Fit, effects: Mapping[str, Effect]) -> list[Step[Fit]]:
    """A step for each effect that was freed; the last ends at `base`."""
    fits = [start, *(_freed(start, names[: k + 1], effects) for k in range(len(names) - 1)), base]
    return [Step(name, *pair) for name, pair in zip(names, pairwise(fits[: len(names) + 1]), strict=True)]


def _first(start: Fit, steps: list[Step[Fit]], found: list[RowCandidate]) -> tuple[RowCandidate, ...]:
    """The candidates on top of the given model; the effect of the first step first, as its full fit shows it.

    The rivals of an effect are those of the search that adds effects; beside others they are not asked.
    """
    if not steps:
        return tuple(found)
    own, *others = with_planned(found, steps[0])
    alone = sum(not step.name.startswith(PREFIX) for step in steps) == 1
    if alone and not own.name.startswith(PREFIX):
        own = with_rivals(own, found, start)
    return own, *others


def structure(start: Fit, effects: Mapping[str, Effect]) -> Structure:
    """The places that act beyond the model of `start`."""
    geometry = _geometry_effects(start, effects)
    return find_structure(start.table, start.problem.white, beyond_base(start), geometry)


def _geometry_effects(start: Fit, effects: Mapping[str, Effect]) -> GeometryEffects:
    """The effects of the geometry, with the forces that they give on the rows of `start`."""
    model = start.model
    for name in GEOMETRY:
        if name in effects and not model.holds(name):
            model = model.with_effect(effects[name])
    layout = Problem.of(model, start.table).layout
    masks = {name: layout.of_effect(name) for name in GEOMETRY if model.holds(name)}
    own = {name: mask for name, mask in masks.items() if mask.any()}  # one axis has no angle to another

    def forces(values: Mapping[str, Array]) -> Array:
        theta = layout.starts()[0]
        for name, value in values.items():
            theta[own[name]] = value
        return force(start.table, [step for step in layout.steps(theta) if step[0].name in values])

    counts = {name: int(mask.sum()) for name, mask in own.items()}
    return GeometryEffects(counts, forces, frozenset(name for name in own if start.model.holds(name)))
