"""Effects and free forms that a structure adds to a model, and the fits of a model with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from calibrations.effects import Effect
from calibrations.fitting.fit import Fit, evaluate, fit, refit
from calibrations.fitting.problem_kinds import make_problem
from calibrations.free_forms.effect import free_form
from calibrations.free_forms.geometry import GEOMETRY
from calibrations.free_forms.place_names import PREFIX, place_of_effect
from calibrations.free_forms.stairs import Stairs
from calibrations.free_forms.structure import Structure
from calibrations.model import Estimate, Model, Term
from calibrations.model.chain import forward
from calibrations.table import Array, Table

BASIC = ("bias", "scale-factor")
BASE_STEPS = 2  # of Gauss and Newton: the base is nearly linear
SMALL = 0.1  # of the value of a cause with which the fit diverged
NO_WORSE = 1.02  # of the error before: one more parameter costs a degree of freedom, a diverged fit costs more


@dataclass(frozen=True)
class Addition:
    """An effect that the structure adds to a model, with its constants and start values."""

    effect: Effect
    constants: Mapping[str, float] = field(default_factory=dict)
    estimates: tuple[Estimate, ...] = ()

    def to(self, model: Model) -> Model:
        """The model with the effect, its parameters at their start values."""
        larger = model.with_effect(self.effect)
        return replace(
            larger, terms=tuple(self._with_start_values(t) if t.name == self.effect.name else t for t in larger.terms)
        )

    def _with_start_values(self, term: Term) -> Term:
        known = {name: value for name, value in self.constants.items() if name in term.effect.constants}
        return replace(term, constants={**term.constants, **known}, estimates=self.estimates)


def additions(structure: Structure, model: Model, effects: Mapping[str, Effect]) -> list[Addition]:
    """The catalogue effects that the structure adds to a model: the largest place first, then geometry."""
    causes = [cause for place in structure.places for cause in (*place.causes, *structure.refinements(place))]
    names = dict.fromkeys([*causes, *structure.geometry.causes, *structure.geometry.refinements])
    possible = [c for c in names if c in effects and effects[c].excluded(structure.result.data.table) is None]
    return [
        Addition(effects[c], structure.constants(c), _start_estimates(structure, effects[c]))
        for c in possible
        if not model.holds(c)
    ]


def _start_estimates(structure: Structure, effect: Effect) -> tuple[Estimate, ...]:
    """The values from which the fit of a cause starts; one that the search has for all axes holds for each."""
    each_axis = {p.name for p in effect.parameters if p.per_axis}
    return tuple(
        Estimate(name, axis, value, None, "")
        for name, given_axis, value in structure.starts(effect.name)
        for axis in (structure.result.data.axes if not given_axis and name in each_axis else (given_axis,))
    )


def rounding_addition(effect: Effect, stairs: Stairs, axes: Sequence[str]) -> Addition:
    """The quantisation of a coarse converter, from its stairs."""
    values = {"step": stairs.step, "offset": stairs.offset, "noise": np.full_like(stairs.step, stairs.noise)}
    estimates = [
        Estimate(name, axis, float(value), None, "")
        for name, of_axes in values.items()
        for axis, value in zip(axes, of_axes.ravel(), strict=True)
    ]
    return Addition(effect, {}, tuple(estimates))


def free_additions(structure: Structure, model: Model) -> list[Addition]:
    """The free forms that the structure adds to a model, the largest place first."""
    free = [Addition(free_form(forms)) for forms in structure.free_forms]
    return [a for a in free if not model.holds(a.effect.name)]


def fit_each_axis(start: Fit, names: list[str], effects: Mapping[str, Effect]) -> Fit:
    """The fit in which each axis has its own value of these effects."""
    model = start.model
    for name in names:
        model = model.with_effect(effects[name])
    return refit(start, model) if names else start


def fit_separately(base: Fit, structure: Structure, added: list[Addition]) -> list[Addition]:
    """The additions with start values: each place's causes fitted to the data minus the other places.

    While other effects are missing, the search for a nonlinear parameter diverges.
    """
    names = {a.effect.name: a for a in added}
    model = _with(base.model, [a for name, a in names.items() if name in GEOMETRY])
    linear = fit(model, _without_part(base.table, structure.others(None))) if model is not base.model else base
    known: dict[str, tuple[Estimate, ...]] = {term.name: term.estimates for term in linear.model.terms}
    for place in structure.places:
        place_additions = [names[cause] for cause in (*place.causes, *structure.refinements(place)) if cause in names]
        if place_additions:
            fitted = fit(_with(linear.model, place_additions), _without_part(base.table, structure.others(place)))
            known |= {a.effect.name: fitted.model.estimates(a.effect.name) for a in place_additions}
    return [replace(a, estimates=known.get(name, a.estimates)) for name, a in names.items()]


def fit_together(base: Fit, added: list[Addition]) -> Fit:
    """Joint fit of all additions."""
    if not added:
        return base
    model = _with(base.model, added)
    return refit(base, model, _start_values(base, model))


def _start_values(base: Fit, model: Model) -> Array:
    """Start values of a model, with those of its base fitted again, given the additions.

    The fit of a single addition has its own bias and scale factor.
    """
    problem, noise = make_problem(model, base.table), base.in_white_noise().noise
    theta = problem.layout.starts()[0]
    base_mask = np.any([problem.layout.of_effect(term.name) for term in base.model.terms], axis=0)
    for _ in range(BASE_STEPS):
        white = noise.whiten(np.dstack([problem.residual(theta)[:, :, None], problem.jacobian(theta, of=base_mask)]))
        theta[base_mask] -= np.linalg.lstsq(white[:, 1:], white[:, 0], rcond=1e-12)[0]
    return theta


def fit_successively(base: Fit, end: Fit, added: list[Addition]) -> list[Fit]:
    """The fits with the first, the first two ... additions; the last is `end`."""
    fits: list[Fit] = []
    present = base
    for addition in added[:-1]:
        present = refit(present, addition.to(present.model))
        fits.append(present)
    return [*fits, end] if added else []


def fit_gradually(base: Fit, added: list[Addition], end: Fit | None = None) -> tuple[list[Addition], list[Fit]]:
    """The additions that do not increase the error, added one by one, and the fits, the first of them `base`.

    An effect far from its true values can make the joint fit diverge. An addition that does not help yet, such as a
    quantiser while a drift is missing, gets another trial after the others. `end`: the joint fit, if it is known.
    """
    accepted: list[Addition] = []
    fits = [base]
    waiting = added
    while waiting:
        postponed: list[Addition] = []
        for addition in waiting:
            complete = end if len(accepted) == len(added) - 1 else None
            larger = complete if complete is not None else refit(fits[-1], addition.to(fits[-1].model))
            if larger.pooled_excess <= NO_WORSE * fits[-1].pooled_excess:
                accepted.append(addition)
                fits.append(larger)
            else:
                postponed.append(addition)
        waiting = postponed if len(postponed) < len(waiting) else []
    return accepted, fits


def fit_one_by_one(base: Fit, added: list[Addition], end: Fit) -> tuple[list[Addition], list[Fit]]:
    """The additions, and the fits from `base` to that of all of them: one addition more in each.

    Those that increase the error are left out, unless they are needed for the error of the joint fit `end`.
    """
    accepted, fits = fit_gradually(base, added, end)
    if fits[-1].pooled_excess < NO_WORSE * end.pooled_excess:
        return accepted, fits
    return added, [base, *fit_successively(base, end, added)]


def causes_alone(end: Fit, forms: list[Addition]) -> Fit:
    """The model without the free forms, at its values in the fit with them."""
    model = end.model
    for form in forms:
        model = model.without(form.effect.name)
    fitted = evaluate(model, end.table)
    assert fitted is not None  # noqa: S101 every parameter has been fitted
    return fitted


def without_forms(end: Fit) -> Fit:
    """The causes fitted to the data minus the free forms of the model; `end` itself if it has none."""
    forms = [term.name for term in end.model.terms if term.name.startswith(PREFIX)]
    if not forms:
        return end
    model = end.model
    for name in forms:
        model = model.without(name)
    fitted = evaluate(model, end.table)
    assert fitted is not None  # noqa: S101 every parameter has been fitted
    steps = (fit_.problem.layout.steps(fit_.theta) for fit_ in (end, fitted))
    with_parts, without_parts = (forward(end.table, chain_steps).T for chain_steps in steps)
    return fit(model, _without_part(end.table, with_parts - without_parts))


def predicted_before(end: Fit, name: str) -> Array:
    """Outputs that a fitted model predicts without one of its effects, (channels, n), in their unit."""
    without = evaluate(end.model.without(name), end.table)
    assert without is not None  # noqa: S101 every parameter has been fitted
    return np.asarray(end.table.outputs.T - without.residual)


def at_values_of(end: Fit, added: list[Addition]) -> list[Addition]:
    """The additions, starting from the values of `end`."""
    return [replace(a, estimates=end.model.estimates(a.effect.name) or a.estimates) for a in added]


def start_small_at_forms(causes: list[Addition], forms: list[Addition]) -> list[Addition]:
    """The causes, with small start values at places with a free form; empty if there is no such place.

    The form can describe the signal of the cause. A cause with a large start value and a wrong nonlinear parameter
    keeps both from the best fit.
    """
    places = {a.effect.name.removeprefix(PREFIX) for a in forms}
    if not any(place_of_effect(a.effect.name) in places for a in causes):
        return []
    return [_small(a) if place_of_effect(a.effect.name) in places else a for a in causes]


def _small(cause: Addition) -> Addition:
    """The cause with small values of its linear parameters: those of either sign that start at 0."""
    linear = {p.name for p in cause.effect.parameters if p.low == -np.inf and p.starts == (0.0,) and p.guess is None}
    estimates = [replace(e, value=SMALL * e.value) if e.name in linear else e for e in cause.estimates]
    return replace(cause, estimates=tuple(estimates))


def largest_first(added: list[Addition], end: Fit, structure: Structure) -> list[Addition]:
    """The additions by the size of their place; those of the geometry by their contribution to the outputs."""
    sizes = {c: place.size for place in structure.places for c in (*place.causes, *structure.refinements(place))}
    for name in (a.effect.name for a in added if a.effect.name not in sizes):
        mask = end.problem.layout.of_effect(name)
        contribution = end.jacobian[:, :, mask] @ end.theta[mask]
        basic = np.any([end.problem.layout.of_effect(basic_name) for basic_name in BASIC], axis=0)
        sizes[name] = float(
            np.sqrt(np.mean((_residual_of(contribution, end.jacobian[:, :, basic]) / structure.white) ** 2))
        )
    return sorted(added, key=lambda a: -sizes[a.effect.name])


def _residual_of(values: Array, columns: Array) -> Array:
    """Residual of values (channels, n) after least squares on columns (channels, n, k) of each channel."""
    return np.stack([v - c @ np.linalg.lstsq(c, v, rcond=None)[0] for v, c in zip(values, columns, strict=True)])


def _with(model: Model, added: list[Addition]) -> Model:
    for addition in added:
        model = addition.to(model)
    return model


def _without_part(table: Table, part: Array | float) -> Table:
    """The table with a part (channels, n) subtracted from its outputs."""
    return table.with_outputs(table.outputs - np.broadcast_to(part, (len(table.axes), table.n)).T)
