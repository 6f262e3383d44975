"""The search for missing effects of poses: first the places that act, then the catalogue effects that are their causes.

Each named cause becomes an effect of the model. The part of a place that its causes do not explain becomes a free form,
and so does a place without a cause: the error falls, and the cause remains unknown.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from calibrations.criteria import MATERIAL, MOST_UNEXPLAINED, SIGNIFICANT
from calibrations.discovery.additions import (
    BASIC,
    NO_WORSE,
    Addition,
    additions,
    at_values_of,
    causes_alone,
    fit_each_axis,
    fit_gradually,
    fit_one_by_one,
    fit_separately,
    fit_successively,
    fit_together,
    free_additions,
    largest_first,
    predicted_before,
    rounding_addition,
    start_small_at_forms,
)
from calibrations.discovery.candidates import RowCandidate
from calibrations.discovery.search import first_order_cost
from calibrations.discovery.significance import chance
from calibrations.discovery.structural_search import StructuralSearch
from calibrations.effects import Effect
from calibrations.fitting.fit import Fit, fit, with_least_white
from calibrations.fitting.problem_kinds import make_problem
from calibrations.fitting.requested_forms import BASE, effects_beyond_base
from calibrations.free_forms.geometry import GEOMETRY, GeometryEffects
from calibrations.free_forms.place_names import PREFIX, PRODUCTS, place_of_effect
from calibrations.free_forms.poses import PoseData
from calibrations.free_forms.search import search
from calibrations.free_forms.stairs import (
    Stairs,
    before_stairs,
    find_stairs,
    fit_stairs,
    noise_before_rounding,
    noise_of_rounded,
)
from calibrations.free_forms.structure import FloorSource, Structure, find_structure, with_stairs
from calibrations.means.noise import rms, with_white
from calibrations.model.chain import force
from calibrations.progress import report
from calibrations.table import Array

STAIRS = "quantisation"
AS_SEARCHED = 1.1  # times the error of a search that follows noise: a fit with a smaller error needs no new search
IDLE = 0.99  # of the error before: an addition that is no cause and leaves a larger error may be left out
NEARLY = 1.5  # noise floors: with a larger error, the stairs are wrong


def search_structure(
    start: Fit, effects: Mapping[str, Effect], ranked: Sequence[RowCandidate] = ()
) -> StructuralSearch:
    """The effects and free forms that the model of `start` misses; `ranked`: the candidates on it, where known."""
    basic = [name for name in BASIC if name in effects and not start.model.holds(name)]
    base = fit_each_axis(start, basic, effects)
    stated_white = start.problem.white
    base, best, floor = _best_structure(base, effects)
    remarks: tuple[str, ...] = ()
    if floor is not None:
        start, ranked = fit(start.model, with_white(start.table, best.structure.white)), ()
        remarks = (f"The noise floor is that of the residual: {floor}.",)
    needed = [name for name in basic if chance(*first_order_cost(best.end, name, shared=True)) < SIGNIFICANT]
    report("fitting the model with one effect more at a time")
    if needed != basic:
        base = fit_each_axis(start, needed, effects).in_floor(base.noise.floor)
    selected, fits = _fit_each_addition(base, best, renew=needed != basic)
    if floor is not None and stated_white is not None:
        fits[-1] = with_least_white(fits[-1], stated_white)
    found = StructuralSearch.of_fits(start, needed, selected, fits, effects, ranked)
    structure = best.structure
    return replace(
        found, places=structure.places, named=structure.causes, rivals=structure.alternatives, remarks=remarks
    )


def _best_structure(base: Fit, effects: Mapping[str, Effect]) -> tuple[Fit, _StructureFit, FloorSource | None]:
    """The structure that leaves the smaller error: of the outputs, or of the outputs before a coarse converter.

    With the fit that it is based on, and the source of the noise floor if the stated floor does not hold.
    """
    stairs_base, from_stairs, remaining_share = _fit_before_stairs(base, effects)
    if from_stairs is not None and stairs_base is not base:
        return stairs_base, from_stairs, FloorSource.ROUNDED
    if from_stairs is not None and (from_stairs.end.held_out_excess <= MATERIAL or remaining_share < MOST_UNEXPLAINED):
        return base, from_stairs, None
    places = structure(base, effects)
    if places.floor_source is not FloorSource.SAMPLES and base.noise.known:
        base = fit(base.model, with_white(base.table, places.white))
        return base, _fit_structure(base, places, effects), places.floor_source
    base = base.in_floor(rms(places.white))
    best = _fit_structure(base, places, effects)
    if from_stairs is not None and from_stairs.end.held_out_excess < min(best.end.held_out_excess, NEARLY):
        best = from_stairs
    return base, best, None


def _fit_each_addition(base: Fit, best: _StructureFit, renew: bool) -> tuple[list[Addition], list[Fit]]:
    """The additions of a structure in their order, and the fits from `base` to the last: one addition more in each.

    `renew`: whether `base` is another one than that of the structure's fit.
    """
    end = best.end
    causes = largest_first(at_values_of(end, best.causes), end, best.structure)
    selected = [*causes, *at_values_of(end, best.forms)]
    if renew:
        end = fit_together(base, selected)
    present, fits = _without_raising_forms(*fit_one_by_one(base, selected, end))
    while True:  # beside a curve that is left out, a cause may have been significant that now is not
        curves = {a.effect.name.removeprefix(PREFIX) for a in present if a.effect.name.startswith(PREFIX)}
        with_curve = [place.causes for place in best.structure.places if place.name in curves]
        needed = needed_causes(with_curve, significant_causes(fits[-1], best.structure.causes))
        fewer, fits = _without_idle_additions(present, fits, needed, set(best.structure.causes) - needed)
        if len(fewer) == len(present):
            return present, fits
        present = fewer


def needed_causes(with_curve: Sequence[Sequence[str]], significant: set[str]) -> set[str]:
    """The significant causes, and those of each place `with_curve` that has none of them.

    The curve of a place describes what its cause does as well; beside a significant cause it describes the others.
    """
    return significant.union(*(causes for causes in with_curve if not significant & set(causes)))


def significant_causes(end: Fit, causes: Sequence[str]) -> set[str]:
    """The causes in the model of `end` whose values noise does not explain."""
    in_model = [name for name in causes if end.model.holds(name)]
    return {name for name in in_model if chance(*first_order_cost(end, name)) < SIGNIFICANT}


def _without_idle_additions(
    selected: list[Addition], fits: list[Fit], needed: Collection[str], insignificant: Collection[str]
) -> tuple[list[Addition], list[Fit]]:
    """The additions and fits without those that lower neither the error of the fit nor the unseen error.

    Slow noise, or a free form beside them, describes their part as well, or it is the product of two causes, of which
    the search takes the sum. All are left out at once, or, where the unseen error grows by that, one after another.
    An `insignificant` cause may have lowered the error until a later one described its part too: each of these is left
    out by itself. The effects that are `needed` are kept. Beside a converter that rounds, the unseen error alone
    decides: what was added before its steps may have followed them, and no linearised test is valid. A cause is not
    left out while the curve of its place stays, which describes it.
    """
    base = fits[0]
    remaining = {
        addition.effect.name: after.pooled_excess / before.pooled_excess if before.pooled_excess > 0 else 1.0
        for addition, (before, after) in zip(selected, pairwise(fits), strict=True)
        if addition.effect.name not in needed
    }
    if any(a.effect.rounds for a in selected):
        remaining = {a.effect.name: 1.0 for a in selected if not a.effect.rounds}
    idle = [a for a in reversed(selected) if remaining.get(a.effect.name, 0.0) >= IDLE]
    idle.sort(key=lambda a: remaining[a.effect.name], reverse=True)
    described = [a for a in selected if a.effect.name in insignificant and a not in idle]
    kept, without = selected, fits[-1]
    least = without.held_out_excess
    for left_out in (idle, *([addition] for addition in idle if len(idle) > 1), *([cause] for cause in described)):
        fewer = [a for a in kept if a not in left_out]
        if not fewer or len(fewer) == len(kept) or _described_by_curves(left_out, fewer):
            continue
        alternative = fit_together(base, fewer)
        if alternative.held_out_excess <= NO_WORSE * least:
            kept, without = fewer, alternative
    if len(kept) == len(selected):
        return selected, fits
    return kept, [base, *fit_successively(base, without, kept)]


def _without_raising_forms(selected: list[Addition], fits: list[Fit]) -> tuple[list[Addition], list[Fit]]:
    """The additions without the free forms with which unseen poses are foreseen worse than without, and their fits."""
    base, kept, end = fits[0], selected, fits[-1]
    for form, (before, after) in reversed(list(zip(selected, pairwise(fits), strict=True))):
        if len(kept) == 1 or after.held_out_excess <= before.held_out_excess or not form.effect.name.startswith(PREFIX):
            continue
        fewer = [a for a in kept if a is not form]
        alternative = fit_together(base, fewer)
        if NO_WORSE * alternative.held_out_excess < end.held_out_excess:
            kept, end = fewer, alternative
    return (selected, fits) if kept is selected else (kept, [base, *fit_successively(base, end, kept)])


def _described_by_curves(left_out: Sequence[Addition], kept: Sequence[Addition]) -> bool:
    """Whether the curve of its place, or of products of forces, describes each effect that is left out."""
    described = {a.effect.name.removeprefix(PREFIX) for a in kept}
    described |= set(PRODUCTS) if "force" in described else set()
    return all(place_of_effect(a.effect.name) in described for a in left_out)


@dataclass(frozen=True)
class _StructureFit:
    """A structure, the additions of its causes and of its free forms, and the fit of all of them."""

    structure: Structure
    causes: list[Addition]
    forms: list[Addition]
    end: Fit


def _fit_structure(base: Fit, places: Structure, effects: Mapping[str, Effect]) -> _StructureFit:
    """Fit of the causes and free forms of a structure; if its residual is more than noise, with the forms renewed."""
    report("fitting the effects and curves that were found")
    joint = _fit_jointly(base, places, additions(places, base.model, effects))
    renewed = _with_renewed_forms(base, joint, effects)
    if renewed.end.held_out_excess > MATERIAL:
        small = start_small_at_forms(at_values_of(renewed.end, renewed.causes), renewed.forms)
        end = fit_together(base, [*small, *renewed.forms]) if small else renewed.end
        if end.held_out_excess < renewed.end.held_out_excess:
            return replace(renewed, causes=small, end=end)
    return renewed


def _fit_jointly(base: Fit, places: Structure, found: list[Addition]) -> _StructureFit:
    """The fit of all causes and free forms together, or one after another where the joint fit diverges.

    A converter rounds the whole output, not the remainder of other places: its companions also start as they were
    found, and the model without the converter is kept if it is as good.
    """
    causes, forms = fit_separately(base, places, found), free_additions(places, base.model)
    end = fit_together(base, [*causes, *forms])
    if any(a.effect.rounds for a in found):
        as_found = [a if a.effect.rounds else separate for a, separate in zip(found, causes, strict=True)]
        alternative = fit_together(base, [*as_found, *forms])
        if alternative.pooled_excess < end.pooled_excess:
            causes, end = as_found, alternative
        smooth = [a for a in causes if not a.effect.rounds]
        alternative = fit_together(base, [*smooth, *forms])
        if alternative.pooled_excess < NO_WORSE * end.pooled_excess:
            causes, end = smooth, alternative
    if end.pooled_excess > base.pooled_excess:  # the joint fit diverged
        accepted, fits = fit_gradually(base, [*causes, *forms])
        causes, forms = ([a for a in accepted if a.effect.name.startswith(PREFIX) is free] for free in (False, True))
        end = fits[-1]
    return _StructureFit(places, causes, forms, end)


def _with_renewed_forms(base: Fit, found: _StructureFit, effects: Mapping[str, Effect]) -> _StructureFit:
    """The fit with the free forms of a new search that is given the fitted causes, if that lowers the unseen error.

    The forms then describe the remainder of these causes. Bias, scale factor and geometry are free in every search, so
    that a new one needs another cause.
    """
    end, places = found.end, found.structure
    reached = places.follows_noise and float(rms(end.residual.ravel())) <= AS_SEARCHED * places.result.error
    given = any(a.effect.name not in BASE for a in found.causes)
    if not given or reached or end.problem.rounds or end.held_out_excess <= MATERIAL:
        return found
    places_beside = structure(causes_alone(end, found.forms), effects, places)
    refined = fit_separately(base, places_beside, additions(places_beside, end.model, effects))
    causes, forms = at_values_of(end, found.causes), [*refined, *free_additions(places_beside, base.model)]
    renewed = replace(found, causes=causes, forms=forms, end=fit_together(base, [*causes, *forms]))
    return renewed if renewed.end.held_out_excess < end.held_out_excess else found


def _fit_before_stairs(base: Fit, effects: Mapping[str, Effect]) -> tuple[Fit, _StructureFit | None, float]:
    """The base, the fit of the effects before a coarse converter, and the remaining share of the excess variance.

    None and 1 without stairs. Means that were rounded have a noise of their own, and so has the base.

    The search uses the outputs before their rounding. The share is that of the same effects without the converter. The
    edges of a coarse converter's steps magnify noise in front of it, so that the error may exceed the noise floor.
    """
    white = base.problem.white
    if STAIRS not in effects or base.model.holds(STAIRS) or "output" in base.table.left_out:
        return base, None, 1.0
    stairs = find_stairs(base.table, base.table.outputs.T - base.residual, white)
    if stairs is None:
        return base, None, 1.0
    known = white is not None
    if white is None:
        white = np.full(base.residual.shape, stairs.noise)
    smooth = fit(base.model, before_stairs(base.table, white, stairs))
    places = structure(smooth, effects)
    causes = fit_separately(smooth, places, additions(places, smooth.model, effects))
    forms = free_additions(places, smooth.model)
    stairs = fit_stairs(base.table, places.result.state.predicted, white, stairs)
    if not known:
        noise = noise_before_rounding(base.table.outputs.T, places.result.state.predicted, stairs)
        stairs, white = replace(stairs, noise=noise), np.full(white.shape, noise)
    if stairs.of_means:
        base = _with_edges_at(base, places.result.state.predicted, white, stairs)
    rounding = rounding_addition(effects[STAIRS], stairs, base.table.axes)
    added = [*causes, rounding, *forms]
    end = fit_together(base, added)
    if stairs.of_means:  # the edges between two codes, once more where this fit has them
        nearer = _with_edges_at(base, predicted_before(end, STAIRS), white, stairs)
        renewed = fit_together(nearer, at_values_of(end, added))
        base, end = (nearer, renewed) if _unseen_error(renewed) < _unseen_error(end) else (base, end)
    unconverted = fit_together(base, [*causes, *forms])
    if unconverted.pooled_excess < NO_WORSE * end.pooled_excess:
        return base, None, 1.0  # as well without: a regular sweep gathers outputs by itself
    assert base.problem.white is not None  # noqa: S101 it is that of the stated noise
    before_rounding = with_stairs(places, base.residual, stairs, base.problem.white)
    structure_fit = _StructureFit(before_rounding, [*causes, rounding], forms, end)
    return base, structure_fit, end.share_left(unconverted)


def _unseen_error(fit: Fit) -> float:
    """Error on unseen poses in the output's unit: the floors of two fits may differ."""
    return fit.held_out_excess * float(rms(fit.noise.floor))


def _with_edges_at(base: Fit, unrounded: Array, white: Array, stairs: Stairs) -> Fit:
    """The fit with the noise that rounded means have about the expected ones, (channels, n)."""
    return fit(base.model, with_white(base.table, noise_of_rounded(unrounded, white, stairs)))


def structure(start: Fit, effects: Mapping[str, Effect], before: Structure | None = None) -> Structure:
    """The places that act beyond the model of `start`, in the noise that the structure `before` found, if it did."""
    white, source = start.problem.white, FloorSource.SAMPLES
    if before is not None and before.floor_source is not source:
        white, source = before.white, before.floor_source
    return find_structure(start.table, white, effects_beyond_base(start), _geometry_effects(start, effects), source)


def residual_beside_places(start: Fit) -> float:
    """The residual beside all places that act in the stated noise of the poses, rms over this noise."""
    white = start.problem.white
    assert white is not None  # noqa: S101 the caller states it
    return search(PoseData.of(start.table), white, effects_beyond_base(start)).ratio


def _geometry_effects(start: Fit, effects: Mapping[str, Effect]) -> GeometryEffects:
    """The effects of the geometry, with the forces that they give on the rows of `start`."""
    model = start.model
    for name in GEOMETRY:
        if name in effects and not model.holds(name):
            model = model.with_effect(effects[name])
    layout = make_problem(model, start.table).layout
    masks = {name: layout.of_effect(name) for name in GEOMETRY if model.holds(name)}
    masks_used = {name: mask for name, mask in masks.items() if mask.any()}  # one axis has no angle to another

    def forces(values: Mapping[str, Array]) -> Array:
        theta = layout.starts()[0]
        for name, value in values.items():
            theta[masks_used[name]] = value
        return force(start.table, [step for step in layout.steps(theta) if step[0].name in values])

    counts = {name: int(mask.sum()) for name, mask in masks_used.items()}
    return GeometryEffects(counts, forces, frozenset(name for name in masks_used if start.model.holds(name)))
