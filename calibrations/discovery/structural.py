"""The search for missing effects of poses: first the places that act, then the catalogue effects that are their causes.

Each named cause becomes an effect of the model. What a place shows beyond its causes becomes a free form, and so does
a place without a cause: the error falls, and the cause remains open.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from calibrations.criteria import MATERIAL
from calibrations.discovery.candidates import RowCandidate, candidates
from calibrations.discovery.results import Step
from calibrations.discovery.search import find_path
from calibrations.effects import Effect
from calibrations.errors import ModelError, TooFewRows
from calibrations.fitting.fit import Fit, fit, refit
from calibrations.fitting.problem import Problem
from calibrations.free_forms.chain import Given
from calibrations.free_forms.effect import free_form
from calibrations.free_forms.geometry import GEOMETRY
from calibrations.free_forms.structure import FloorSource, Structure, find_structure
from calibrations.model import Estimate, Model, Term
from calibrations.model.chain import forward
from calibrations.table import Array, Table

BASIC = ("bias", "scale-factor")
BASE = (*BASIC, *GEOMETRY)


FEWEST_ROWS = 24  # poses that can show where something acts


@dataclass(frozen=True)
class StructuralSearch:
    """The end of a search: the given model, the steps beyond it, and the places that act.

    `candidates`: every effect of the catalogue alone on top of the given model.
    """

    start: Fit
    steps: tuple[Step[Fit], ...]
    structure: Structure
    candidates: tuple[RowCandidate, ...]
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
        return {name: self.structure.alternatives[name] for name in self.causes if name in self.structure.alternatives}


def check_structure(table: Table) -> None:
    """Raises ModelError for a table that is not poses, TooFewRows for poses that are too few to show a place."""
    if not table.type.stage_angles:
        raise ModelError(
            f"{table.source}: places of the signal chain are found in poses at known stage angles, "
            f"and this is a table of {table.kind}"
        )
    if table.n < FEWEST_ROWS:
        raise TooFewRows(
            f"{table.source}: {table.n} poses cannot show where something acts; measure at least {FEWEST_ROWS}, "
            "at several inclinations and from both sides of beta"
        )


def search_structure(start: Fit, effects: Mapping[str, Effect]) -> StructuralSearch:
    """The effects and free forms that the model of `start` misses."""
    basic = {name: effects[name] for name in BASIC if name in effects and not start.model.holds(name)}
    first = find_path(start, (), basic) if basic else None
    base = first.end if first is not None else start
    found = structure(base, effects)
    remarks: tuple[str, ...] = ()
    if found.floor_source is FloorSource.CONTRADICTED and start.noise.known:
        start, base = (fit(f.model, without_counts(f.table)) for f in (start, base))
        remarks = (f"The noise floor is that of the residual: {FloorSource.CONTRADICTED}.",)
    chosen = additions(found, base.model, effects)
    fits = [base, *fitted(base, chosen)]
    steps = [Step(s.taken.name, s.before, s.after) for s in first.steps] if first is not None else []
    steps += [Step(a.effect.name, *pair) for a, pair in zip(chosen, pairwise(fits), strict=True)]
    return StructuralSearch(start, tuple(steps), found, tuple(candidates(start, effects)), remarks)


def without_counts(table: Table) -> Table:
    """The table without the number of samples of each mean: its noise is then what the residual shows."""
    return replace(table, columns={name: column for name, column in table.columns.items() if name != "n"})


@dataclass(frozen=True)
class Addition:
    """An effect that the structure adds to a model, with constants and values to start from that are known from it."""

    effect: Effect
    constants: Mapping[str, float] = field(default_factory=dict)
    starts: tuple[tuple[str, str, float], ...] = ()

    def to(self, model: Model) -> Model:
        """The model with the effect."""
        larger = model.with_effect(self.effect)
        return self.restarted(larger)

    def restarted(self, model: Model) -> Model:
        """The model with the effect's parameters at the values to start from."""
        return replace(model, terms=tuple(self._begun(t) if t.name == self.effect.name else t for t in model.terms))

    def _begun(self, term: Term) -> Term:
        known = {name: value for name, value in self.constants.items() if name in term.effect.constants}
        starts = tuple(Estimate(name, axis, value, None, "") for name, axis, value in self.starts)
        return replace(term, constants={**term.constants, **known}, estimates=starts)


def structure(start: Fit, effects: Mapping[str, Effect]) -> Structure:
    """The places that act beyond the model of `start`."""
    problem = start.problem
    has = {term.name for term in start.model.terms}
    geometries = {name: _derivatives(start, effects[name]) for name in GEOMETRY if name in effects}
    return find_structure(start.table, problem.white, _given(start), geometries, has & set(GEOMETRY))


def additions(found: Structure, model: Model, effects: Mapping[str, Effect]) -> list[Addition]:
    """The effects that the structure adds: causes, the largest place first, then geometry, then free forms."""
    causes = [cause for place in found.places for cause in place.causes]
    named = [
        Addition(effects[c], found.constants(c), found.starts(c))
        for c in (*causes, *found.geometry.causes)
        if c in effects
    ]
    free = [Addition(free_form(forms)) for forms in found.free_forms]
    return [a for a in {a.effect.name: a for a in (*named, *free)}.values() if not model.holds(a.effect.name)]


def fitted(start: Fit, added: list[Addition]) -> list[Fit]:
    """The fits with the first, the first two ... additions."""
    fits: list[Fit] = []
    present = start
    for addition in added:
        present = refit(present, addition.to(present.model))
        fits.append(present)
    if len(added) > 1 and present.pooled_excess > MATERIAL:
        fits[-1] = min(present, _restarted(present, added), key=lambda f: f.pooled_excess)
    return fits


def _restarted(end: Fit, added: list[Addition]) -> Fit:
    """The last fit from where the search saw its effects: a fit goes astray while others are still missing."""
    model = end.model
    for addition in added:
        if addition.starts:
            model = addition.restarted(model)
    return refit(end, model) if model is not end.model else end


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
