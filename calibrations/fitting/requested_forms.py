"""Sizes of the free forms that a person asks for by place, estimated together with a model by restricted likelihood.

The forms of the place compete as in the search for places, without those that can follow almost anything, such as a
random walk. One of them is always kept, however small: a person asked for it, and at a size near zero it changes
nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from calibrations.effects import Effect
from calibrations.errors import ModelError
from calibrations.fitting.residual_forms import SMALLEST, estimate_by_residual
from calibrations.fitting.solution import Solution
from calibrations.free_forms.bases import Harmonics, StraightLine
from calibrations.free_forms.chain import ModelEffects, State, start, state_at
from calibrations.free_forms.components import Component, free
from calibrations.free_forms.descent import SLOW_BEGIN, SLOW_MOST
from calibrations.free_forms.effect import free_form
from calibrations.free_forms.form import Factor, Form
from calibrations.free_forms.geometry import GEOMETRY, Geometry
from calibrations.free_forms.places import components
from calibrations.free_forms.poses import PoseData
from calibrations.free_forms.reml import coefficients, estimate, gains, scale_components
from calibrations.free_forms.requested import RequestedForm
from calibrations.free_forms.search_result import Point, SearchResult, Setting, finish
from calibrations.free_forms.selection import ENTER, select
from calibrations.free_forms.structure import FloorSource, Structure
from calibrations.model import Model
from calibrations.model.chain import forward
from calibrations.table import Array

BASE = ("bias", "scale-factor", *GEOMETRY)  # effects whose linear parts the search has in its base
ROUNDS = 6
FLOOR_KNOWN = 0.02  # of the noise: a smaller change of a noise that only the residual shows


def find_requested(model: Model) -> tuple[RequestedForm, ...]:
    """The free forms of a model that have no sizes yet."""
    return tuple(term.effect for term in model.terms if isinstance(term.effect, RequestedForm))


def without_requested(model: Model) -> Model:
    """The model without the free forms that have no sizes yet."""
    for effect in find_requested(model):
        model = replace(model, terms=tuple(term for term in model.terms if term.effect is not effect))
    return model


def with_sizes(model: Model, smaller: Solution) -> Model:
    """The model with sizes for its free forms, from the data of `smaller`, which is the model without them.

    Raises ModelError with the data that would be needed.
    """
    for effect in find_requested(model):
        sized = estimate_form(smaller, effect)
        terms = tuple(replace(term, effect=sized) if term.effect is effect else term for term in model.terms)
        model = replace(model, terms=terms)
    return model


def effects_beyond_base(fit: Solution) -> ModelEffects:
    """Contribution of the effects other than bias, scale factor and geometry."""
    problem = fit.problem
    names = [term.name for term in fit.problem.layout.model.terms if term.name not in BASE]
    shape = fit.residual.shape
    if not names:
        return ModelEffects(np.zeros(shape), np.zeros((*shape, 0)))
    steps = problem.layout.steps(fit.theta)
    base = [step for step in steps if step[0].name in BASE]
    contribution = (forward(fit.table, steps) - forward(fit.table, base)).T
    mask = np.any([problem.layout.of_effect(name) for name in names], axis=0)
    return ModelEffects(contribution, -fit.jacobian[:, :, mask])


def estimate_form(smaller: Solution, effect: RequestedForm) -> Effect:
    """The free form with the sizes that the data of `smaller` show. Raises ModelError."""
    table = smaller.table
    if (reason := effect.excluded(table)) is not None:
        raise ModelError(f"{effect.name} {reason} ({table.source})")
    if not table.type.stage_angles:
        return estimate_by_residual(smaller, effect.place)
    table = replace(table, left_out=())
    data, model_effects = PoseData.of(table), effects_beyond_base(smaller)
    first = state_at(data, model_effects, start(data, model_effects), ())
    all_components = components(data, first)
    forms = [c for c in all_components if c.place == effect.place and c.form is not None]
    simple_forms = [c for c in forms if not c.general] or forms
    forms = [*_completing_components(effect.place, data, first), *simple_forms]
    if not forms:
        raise ModelError(f"{effect.name} cannot be estimated from {table.source}: its driver does not change there")
    result = _estimate_forms(smaller, data, model_effects, [c for c in all_components if c.noise], forms)
    structure = Structure(result, (), Geometry(), result.white, FloorSource.SAMPLES)
    return free_form(tuple(structure._sized(name) for name in result.active))


def _completing_components(place: str, data: PoseData, first: State) -> list[Component]:
    """Forms whose part in the search belongs to an effect of the catalogue: lines, and the first harmonic of beta."""
    if place == "stage-angle-beta":
        return [free(Form(place, "first", "beta", (Harmonics(1, 1),), shared=True), first)]
    if place in ("temperature-bias", "temperature-scale"):
        T = data.table.column("temperature_c")
        factor: Factor = "force" if place.endswith("scale") else ""
        return [
            free(Form(place, "line", "temperature", (StraightLine(float(T.min()), float(T.max())),), factor), first)
        ]
    if place == "column:std" and data.spread is not None:
        lines = tuple(StraightLine(float(q.min()), float(q.max())) for q in data.spread**2)
        return [free(Form(place, "line", "variance", lines), first)]
    return []


def _estimate_forms(
    smaller: Solution, data: PoseData, model_effects: ModelEffects, noise: list[Component], forms: list[Component]
) -> SearchResult:
    """The forms that act, with their sizes. Unknown white noise is estimated from the residual, in rounds."""
    stated_white = smaller.problem.white
    white = np.tile(smaller.noise.floor[:, None], (1, data.n)) if stated_white is None else stated_white
    for _ in range(ROUNDS):
        result = _size_forms(data, model_effects, white, noise, forms)
        if stated_white is not None:
            break
        scaled = white * result.ratio
        settled = abs(result.ratio - 1) < FLOOR_KNOWN
        white = scaled
        if settled:
            break
    return result


def _size_forms(
    data: PoseData, model_effects: ModelEffects, white: Array, noise: list[Component], forms: list[Component]
) -> SearchResult:
    """Selection among the forms and Gauss-Newton steps."""
    setting = Setting(data, white, model_effects)
    values = start(data, model_effects)
    point = Point(
        [*noise, *forms],
        {c.name: (SLOW_BEGIN * setting.floor) ** 2 for c in noise},
        values,
        setting.state_at(values, ()),
    )
    limits = setting.slow_limits(noise, SLOW_MOST)
    by_name = {c.name: c for c in forms}
    scales: Mapping[str, float] = {}
    for number in range(ROUNDS):
        X, g = setting.linearise(point, scales)
        if number == 0:
            X, g = scale_components(X, g)
        scales = g.scales
        sizes = select(g, estimate(g, point.variances, limits), point.components, [by_name], limits, ENTER, number > 0)
        if not any(name in sizes.variances for name in by_name) and len(sizes.variances) == len(noise):
            gained = gains(g, sizes, list(by_name))
            best = max(gained, key=lambda name: gained[name][0])
            least = (SMALLEST * setting.floor) ** 2
            sizes = estimate(g, {**sizes.variances, best: max(gained[best][1], least)}, limits)
        values = coefficients(g, sizes)
        moved = Point(point.components, sizes.variances, values, setting.state_at(values, point.components))
        change, point = setting.change(point.state, moved.state), moved
        if number > 0 and change < FLOOR_KNOWN:
            break
    return finish(setting, point, scales, limits)
