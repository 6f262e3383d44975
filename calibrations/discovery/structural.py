"""The search for missing effects of poses: first the places that act, then the catalogue effects that are their causes.

Each named cause becomes an effect of the model. What a place shows beyond its causes becomes a free form, and so does
a place without a cause: the error falls, and the cause remains open.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from calibrations.criteria import MATERIAL, SIGNIFICANT
from calibrations.discovery.candidates import RowCandidate, candidates, with_planned, with_rivals
from calibrations.discovery.results import Step
from calibrations.discovery.search import first_order
from calibrations.discovery.significance import chance
from calibrations.effects import Effect
from calibrations.fitting.fit import Fit, evaluate, fit, refit
from calibrations.fitting.problem import Problem
from calibrations.free_forms.chain import Given
from calibrations.free_forms.effect import free_form
from calibrations.free_forms.geometry import GEOMETRY
from calibrations.free_forms.place_names import PREFIX, place_of_effect
from calibrations.free_forms.stairs import before_stairs, find_stairs, fitted_stairs
from calibrations.free_forms.structure import FloorSource, Structure, find_structure, with_stairs
from calibrations.means.noise import Noise, white_only, with_white
from calibrations.model import Estimate, Model, Term
from calibrations.model.chain import forward
from calibrations.table import Array, Table

BASIC = ("bias", "scale-factor")
BASE = (*BASIC, *GEOMETRY)
BASE_STEPS = 2  # of Gauss and Newton's: hardly anything of the base is not linear
STAIRS = "quantisation"
NEARLY = 1.5  # noise floors: with more the stairs were not the right ones
SMALL = 0.1  # of the value of a cause that led the fit astray
NO_WORSE = 1.02  # of the error before: a parameter more costs a degree of freedom, a fit gone astray more


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
    behind = _behind_stairs(base, effects)
    remarks: tuple[str, ...] = ()
    if behind is not None and behind.end.held_out_excess <= MATERIAL:
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
    chosen = [*_largest_first(_at(end, causes), end, found), *_at(end, forms)]
    if needed != basic:
        base = _freed(start, needed, effects)
        end = together(base, chosen)
    fits = [base, *fitted(base, end, chosen)]
    if any(later.pooled_excess > NO_WORSE * earlier.pooled_excess for earlier, later in pairwise(fits)):
        names = [a.effect.name for a in chosen]
        taken, falling = gradually(base, sorted([*causes, *forms], key=lambda a: names.index(a.effect.name)))
        if falling[-1].pooled_excess < NO_WORSE * end.pooled_excess:
            chosen, fits, end = taken, falling, falling[-1]
            forms = [a for a in chosen if a.effect.name.startswith(PREFIX)]
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
        other = together(base, [*_at(end, causes), *others])
        if other.held_out_excess < end.held_out_excess:
            causes, forms, end = _at(end, causes), others, other
    if end.held_out_excess > MATERIAL and (small := _small_beside_forms(_at(end, causes), forms)):
        other = together(base, [*small, *forms])
        if other.held_out_excess < end.held_out_excess:
            causes, end = small, other
    return _Named(found, causes, forms, end)


def _small_beside_forms(causes: list[Addition], forms: list[Addition]) -> list[Addition]:
    """The causes with those small at whose place a free form acts; none where there is no such place.

    The form can hold what the cause describes. A cause that begins large, at a wrong value of what is not linear, keeps
    both from the best fit.
    """
    places = {a.effect.name.removeprefix(PREFIX) for a in forms}
    if not any(place_of_effect(a.effect.name) in places for a in causes):
        return []
    return [_small(a) if place_of_effect(a.effect.name) in places else a for a in causes]


def _small(cause: Addition) -> Addition:
    """The cause with those parameters small that it is linear in: of either sign, and 0 where nothing is known."""
    linear = {p.name for p in cause.effect.parameters if p.low == -np.inf and p.starts == (0.0,) and p.guess is None}
    estimates = [replace(e, value=SMALL * e.value) if e.name in linear else e for e in cause.estimates]
    return replace(cause, estimates=tuple(estimates))


def _behind_stairs(base: Fit, effects: Mapping[str, Effect]) -> _Named | None:
    """What acts before a coarse converter, searched for in the outputs before their rounding; None: no stairs show."""
    white = base.problem.white
    if STAIRS not in effects or base.model.holds(STAIRS) or white is None or "output" in base.table.left_out:
        return None
    stairs = find_stairs(base.table, base.table.outputs.T - base.residual, white)
    if stairs is None:
        return None
    smooth = fit(base.model, before_stairs(base.table, white, stairs))
    found = structure(smooth, effects)
    causes = separately(smooth, found, additions(found, smooth.model, effects))
    forms = free_additions(found, smooth.model)
    stairs = fitted_stairs(base.table, found.result.state.predicted, white, stairs)
    values = {"step": stairs.step, "offset": stairs.offset, "noise": stairs.noise}
    rounding = Addition(
        effects[STAIRS], {}, tuple(Estimate(name, "", value, None, "") for name, value in values.items())
    )
    end = together(base, [*causes, rounding, *forms])
    if together(base, [*causes, *forms]).pooled_excess < NO_WORSE * end.pooled_excess:
        return None  # as well without: a regular sweep gathers outputs by itself
    return _Named(with_stairs(found, base.residual, stairs, white), [*causes, rounding], forms, end)


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


@dataclass(frozen=True)
class Addition:
    """An effect that the structure adds to a model, with constants and values to start from that are known from it."""

    effect: Effect
    constants: Mapping[str, float] = field(default_factory=dict)
    estimates: tuple[Estimate, ...] = ()

    def to(self, model: Model) -> Model:
        """The model with the effect, its parameters at the values to start from."""
        larger = model.with_effect(self.effect)
        return replace(larger, terms=tuple(self._begun(t) if t.name == self.effect.name else t for t in larger.terms))

    def _begun(self, term: Term) -> Term:
        known = {name: value for name, value in self.constants.items() if name in term.effect.constants}
        return replace(term, constants={**term.constants, **known}, estimates=self.estimates)


def structure(start: Fit, effects: Mapping[str, Effect]) -> Structure:
    """The places that act beyond the model of `start`."""
    problem = start.problem
    has = {term.name for term in start.model.terms}
    geometries = {name: _derivatives(start, effects[name]) for name in GEOMETRY if name in effects}
    return find_structure(start.table, problem.white, _given(start), geometries, has & set(GEOMETRY))


def additions(found: Structure, model: Model, effects: Mapping[str, Effect]) -> list[Addition]:
    """The catalogue effects that the structure adds to a model: the largest place first, then geometry."""
    causes = [cause for place in found.places for cause in (*place.causes, *found.refinements(place))]
    names = dict.fromkeys([*causes, *found.geometry.causes, *found.geometry.refinements])
    starts = {c: tuple(Estimate(name, axis, value, None, "") for name, axis, value in found.starts(c)) for c in names}
    possible = [c for c in names if c in effects and effects[c].excluded(found.result.data.table) is None]
    return [Addition(effects[c], found.constants(c), starts[c]) for c in possible if not model.holds(c)]


def free_additions(found: Structure, model: Model) -> list[Addition]:
    """The free forms that the structure adds to a model, the largest place first."""
    free = [Addition(free_form(forms)) for forms in found.free_forms]
    return [a for a in free if not model.holds(a.effect.name)]


def separately(base: Fit, found: Structure, added: list[Addition]) -> list[Addition]:
    """The additions with values to start from: each place's causes fitted to what the other places leave.

    Beside other effects that are missing, the search for a nonlinear parameter goes astray.
    """
    names = {a.effect.name: a for a in added}
    model = _with(base.model, [a for name, a in names.items() if name in GEOMETRY])
    linear = fit(model, _less(base.table, found.others(None))) if model is not base.model else base
    known: dict[str, tuple[Estimate, ...]] = {term.name: term.estimates for term in linear.model.terms}
    for place in found.places:
        own = [names[cause] for cause in (*place.causes, *found.refinements(place)) if cause in names]
        if own:
            alone = fit(_with(linear.model, own), _less(base.table, found.others(place)))
            known |= {a.effect.name: alone.model.estimates(a.effect.name) for a in own}
    return [replace(a, estimates=known.get(name, a.estimates)) for name, a in names.items()]


def together(base: Fit, added: list[Addition]) -> Fit:
    """All additions fitted at once, in white noise first.

    The noise of `base` has taken up what the additions explain, and free forms give way to a noise that is so large.
    """
    if not added:
        return base
    problem = base.problem
    white = white_only(problem.white, problem.gap_s, len(problem.channels), problem.given)
    model = _with(base.model, added)
    return refit(replace(base, noise=white), model, _begun(base, model, white))


def _begun(base: Fit, model: Model, noise: Noise) -> Array:
    """The values of a model to start from, those of its base fitted beside the others.

    Each addition was fitted alone, and took its own bias and scale factor with it.
    """
    problem = Problem.of(model, base.table)
    theta = problem.layout.starts()[0]
    own = np.any([problem.layout.of_effect(term.name) for term in base.model.terms], axis=0)
    for _ in range(BASE_STEPS):
        white = noise.whiten(np.dstack([problem.residual(theta)[:, :, None], problem.jacobian(theta, of=own)]))
        theta[own] -= np.linalg.lstsq(white[:, 1:], white[:, 0], rcond=1e-12)[0]
    return theta


def fitted(base: Fit, end: Fit, added: list[Addition]) -> list[Fit]:
    """The fits with the first, the first two ... additions; the last is `end`."""
    fits: list[Fit] = []
    present = base
    for addition in added[:-1]:
        present = refit(present, addition.to(present.model))
        fits.append(present)
    return [*fits, end] if added else []


def gradually(base: Fit, added: list[Addition]) -> tuple[list[Addition], list[Fit]]:
    """The additions that make the error no larger, each beside those before it, and the fits, the first of them `base`.

    An effect far from the truth can lead the fit of all to a place from which no way leads back. One that does not help
    yet, such as a quantiser beside a drift that is missing, is tried again beside the others.
    """
    taken: list[Addition] = []
    fits = [base]
    waiting = added
    while waiting:
        postponed: list[Addition] = []
        for addition in waiting:
            larger = refit(fits[-1], addition.to(fits[-1].model))
            if larger.pooled_excess <= NO_WORSE * fits[-1].pooled_excess:
                taken.append(addition)
                fits.append(larger)
            else:
                postponed.append(addition)
        waiting = postponed if len(postponed) < len(waiting) else []
    return taken, fits


def causes_alone(end: Fit, forms: list[Addition]) -> Fit:
    """The model without the free forms, at the values that it has beside them."""
    model = end.model
    for form in forms:
        model = model.without(form.effect.name)
    alone = evaluate(model, end.table)
    assert alone is not None  # noqa: S101 every parameter has been fitted
    return alone


def without_forms(end: Fit) -> Fit:
    """The causes fitted to the data less what the free forms of the model add; `end` itself where it has none."""
    forms = [term.name for term in end.model.terms if term.name.startswith(PREFIX)]
    if not forms:
        return end
    model = end.model
    for name in forms:
        model = model.without(name)
    alone = evaluate(model, end.table)
    assert alone is not None  # noqa: S101 every parameter has been fitted
    steps = (fit_.problem.layout.steps(fit_.theta) for fit_ in (end, alone))
    whole, rest = (forward(end.table, each).T for each in steps)
    return fit(model, _less(end.table, whole - rest))


def _at(end: Fit, added: list[Addition]) -> list[Addition]:
    """The additions, starting from the values of `end`."""
    return [replace(a, estimates=end.model.estimates(a.effect.name) or a.estimates) for a in added]


def _largest_first(added: list[Addition], end: Fit, found: Structure) -> list[Addition]:
    """The additions by the size of their place; those of the geometry by what they contribute to the outputs."""
    sizes = {c: place.size for place in found.places for c in (*place.causes, *found.refinements(place))}
    for name in (a.effect.name for a in added if a.effect.name not in sizes):
        mask = end.problem.layout.of_effect(name)
        contribution = end.jacobian[:, :, mask] @ end.theta[mask]
        basic = np.any([end.problem.layout.of_effect(own) for own in BASIC], axis=0)
        sizes[name] = float(np.sqrt(np.mean((_beside(contribution, end.jacobian[:, :, basic]) / found.white) ** 2)))
    return sorted(added, key=lambda a: -sizes[a.effect.name])


def _beside(values: Array, columns: Array) -> Array:
    """Values (channels, n) without what columns (channels, n, k) explain of each channel."""
    return np.stack([v - c @ np.linalg.lstsq(c, v, rcond=None)[0] for v, c in zip(values, columns, strict=True)])


def _with(model: Model, added: list[Addition]) -> Model:
    for addition in added:
        model = addition.to(model)
    return model


def _less(table: Table, part: Array | float) -> Table:
    """The table with a part (channels, n) taken off its outputs."""
    return table.with_outputs(table.outputs - np.broadcast_to(part, (len(table.axes), table.n)).T)


def _derivatives(start: Fit, effect: Effect) -> Array:
    """d output / d parameters of an effect at 0, in the model of `start`, (channels, n, m)."""
    model = start.model if start.model.holds(effect.name) else start.model.with_effect(effect)
    problem = Problem.of(model, start.table)
    theta = problem.layout.starts()[0]
    return -problem.jacobian(theta, of=problem.layout.of_effect(effect.name))


def _given(start: Fit) -> Given:
    """What the model's effects beyond bias, scale factor and geometry contribute."""
    problem = start.problem
    others = [term.name for term in start.model.terms if term.name not in BASE]
    shape = start.residual.shape
    if not others:
        return Given(np.zeros(shape), np.zeros((*shape, 0)))
    steps = problem.layout.steps(start.theta)
    base = [step for step in steps if step[0].name in BASE]
    contribution = (forward(start.table, steps) - forward(start.table, base)).T
    mask = np.any([problem.layout.of_effect(name) for name in others], axis=0)
    return Given(contribution, -start.jacobian[:, :, mask])
