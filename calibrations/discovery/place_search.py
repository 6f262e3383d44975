"""The search for missing effects of rows without stage angles: first the places that act, then their causes.

It follows that of poses (`structural.py`) with what the residual shows of each place (`fitting/residual_forms.py`).
Each place gets a free form. An effect of the catalogue is the cause of a place if the form is not needed beside it,
or if it takes up most of the form. Else the place keeps its form, and its cause is unknown.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce

import numpy as np

from calibrations.criteria import CLEARLY_BETTER, MATERIAL, PATTERN_BETTER, SIGNIFICANT
from calibrations.discovery.additions import BASIC, Addition, at_values_of, fit_each_axis, fit_one_by_one
from calibrations.discovery.candidates import RowCandidate, candidates, refit_with, with_rivals
from calibrations.discovery.curves import CurveRows
from calibrations.discovery.search import first_order_cost
from calibrations.discovery.significance import chance
from calibrations.discovery.structural_search import StructuralSearch
from calibrations.effects import Effect
from calibrations.errors import TooFewRows
from calibrations.fitting.determined import loses_parameters
from calibrations.fitting.fit import Fit, refit
from calibrations.fitting.noise_fit import deviance
from calibrations.fitting.residual_forms import ResidualForms, forms_at
from calibrations.free_forms.acting_places import ActingPlace
from calibrations.free_forms.effect import free_form
from calibrations.free_forms.geometry import GEOMETRY, LINEAR_PART
from calibrations.free_forms.naming import FIRST_FORM, FOLLOWERS, MOST_NAMES, NAMED, NEXT_FORM
from calibrations.free_forms.place_names import EFFECTS_AT, PREFIX, place_of_effect
from calibrations.free_forms.poses import logged_columns
from calibrations.free_forms.reml import Sizes, estimate
from calibrations.free_forms.requested import DRIVERS, RequestedForm, shortage
from calibrations.free_forms.rivals import CLOSE
from calibrations.free_forms.selection import ENTER, prices
from calibrations.means.noise import rms
from calibrations.model import Model
from calibrations.progress import report

ROUNDS = 4  # in which the scatter of the rows is found from what the forms leave
TRIALS = 3  # effects of any place that are fitted in the place of a form; those of its own place are fitted as well
OF_MOTION = ("displacement_m", "acceleration_m_s2")  # columns of what moves the sensor
SETTLED = 1.05  # of the scatter: a smaller change is none


@dataclass(frozen=True)
class _Place:
    """A place that acts, and the effects that are its causes.

    gain    of twice the log-likelihood by its forms, less their price
    share   of the form's squares that the causes explain
    rivals  other places that explain the data as well
    rivals_of_causes  by cause, other effects that explain the data as well
    """

    name: str
    gain: float
    causes: tuple[str, ...] = ()
    share: float = 0.0
    rivals: tuple[str, ...] = ()
    rivals_of_causes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def search_places(start: Fit, effects: Mapping[str, Effect]) -> StructuralSearch | None:
    """The effects and free forms that the model of `start` misses; None if no place acts beyond the noise.

    None as well for rows that do not determine the linear effects.
    """
    report("searching for the places that act")
    try:
        base = _fit_with_linear_effects(start, effects)
    except TooFewRows:  # then they show no place either
        return None
    possible = _possible_places(base)
    acting = _acting_forms(base, possible).following_columns if possible else None
    if acting is None or not acting.by_place:
        return None
    present = refit(base, reduce(Model.with_effect, acting.effects, base.model))
    if loses_parameters(start, present) or not _score(present) > _score(start) + PATTERN_BETTER:
        return None  # slow noise, or scatter, explains the residual as well
    report("fitting the effects and curves that were found")
    places = [_Place(name, acting.gain(name), rivals=tuple(acting.rivals(name))) for name in acting.by_place]
    named: list[_Place] = []
    for place in sorted(places, key=lambda p: -p.gain):
        present, found = _name(place, present, effects)
        named.append(found)
    return _as_search(start, base, present, named, effects)


@dataclass(frozen=True)
class _ActingForms:
    """The forms that act among those that a residual can show, with their sizes."""

    of_residual: ResidualForms
    sizes: Sizes

    @cached_property
    def by_place(self) -> dict[str, list[str]]:
        """The names of the forms of each place."""
        names: dict[str, list[str]] = {}
        for name in self.sizes.variances:
            names.setdefault(self.of_residual.forms[name].place, []).append(name)
        return names

    @property
    def effects(self) -> list[Effect]:
        """The free form of each place."""
        return [
            free_form(tuple(self.of_residual.sized(n, self.sizes) for n in names)) for names in self.by_place.values()
        ]

    def gain(self, place: str) -> float:
        """What the forms of a place together gain of -2 log likelihood, less their price."""
        gained = self.of_residual.deviance(self._without(place)) - self.of_residual.deviance(self.sizes)
        return gained - prices([self.of_residual.components[name] for name in self.by_place[place]])

    @property
    def significant(self) -> _ActingForms:
        """The same without places whose gain is chance in the uncertain scatter of the rows, the weakest first."""
        weakest = min(self.by_place, key=self.gain, default=None)
        if weakest is None or self.gain(weakest) > ENTER:
            return self
        return replace(self, sizes=self._without(weakest)).significant

    def rivals(self, place: str) -> dict[str, Sizes]:
        """Other places whose forms explain as well what those of a place explain, and the sizes with them instead."""
        components, reduced = self.of_residual.components, self._without(place)
        most = self.sizes.deviance + prices([components[n] for n in self.by_place[place]]) + CLOSE
        rivals = {}
        for rival in dict.fromkeys(form.place for form in self.of_residual.forms.values()):
            if rival not in self.by_place:
                instead = self.of_residual.add([n for n, c in components.items() if c.place == rival], reduced)
                added = [components[n] for n in instead.variances if n not in reduced.variances]
                if added and instead.deviance + prices(added) < most:
                    rivals[rival] = instead
        return rivals

    @property
    def following_columns(self) -> _ActingForms:
        """The forms over a temperature, or over the scatter, in place of a curve over time that explains no more.

        A curve over time follows every column that changes slowly.
        """
        present = self
        for place in FOLLOWERS:
            if place in present.by_place:
                rivals = present.rivals(place)
                followed = [rivals[name] for name in FOLLOWERS[place] if name in rivals]
                present = min((replace(self, sizes=sizes) for sizes in followed),
                              key=lambda acting: acting.sizes.deviance, default=present)  # fmt: skip
        return present

    def _without(self, place: str) -> Sizes:
        remaining = {n: v for n, v in self.sizes.variances.items() if n not in self.by_place[place]}
        return estimate(self.of_residual.gram, remaining, {})


def _fit_with_linear_effects(start: Fit, effects: Mapping[str, Effect]) -> Fit:
    """The fit with bias and scale factor of each axis and all geometry, which no place takes up."""
    names = [
        name
        for name in (*BASIC, *GEOMETRY)
        if name in effects and not start.model.holds(name) and effects[name].excluded(start.table) is None
    ]
    return fit_each_axis(start, names, effects)


def _possible_places(fit: Fit) -> list[str]:
    """The places of which these rows can show a free form, without those that the model has."""
    columns = [f"column:{name}" for name in ("std", "supply_v", *logged_columns(fit.table)) if name not in OF_MOTION]
    possible = [name for name in (*DRIVERS, *columns) if shortage(name, fit.table) is None]
    return [name for name in possible if name not in fit.table.left_out and not fit.model.holds(f"{PREFIX}{name}")]


def _acting_forms(fit: Fit, places: Iterable[str]) -> _ActingForms:
    """The forms of these places that act, in noise with the scatter that they leave; at least that of the samples."""
    forms = {name: form for place in places for name, form in forms_at(place, fit).items()}
    scatter, least = 1.0, 1.0 if fit.problem.white is not None else 0.0
    for _ in range(ROUNDS):
        residual_forms = ResidualForms.of(fit.in_white_noise(), forms, scatter=scatter)
        settled, scatter = scatter, max(least, scatter * residual_forms.excess(residual_forms.selected))
        if max(scatter / settled, settled / scatter) < SETTLED or not residual_forms.selected.variances:
            break
    return _ActingForms(residual_forms, residual_forms.selected).significant


def _score(fit: Fit) -> float:
    """Twice the log-likelihood, less log(rows) for each parameter that the rows determine (Schwarz)."""
    likelihood = -deviance(fit.noise, fit.residual, fit.free_jacobian, np.zeros((fit.table.n, 0)))
    return likelihood - fit.effective_parameters * float(np.log(fit.residual.size))


def _squares(fit: Fit, present: Fit) -> float:
    """Sum of squares of the residual in the noise of the rows; in the residual of `present` where none is known."""
    if fit.problem.white is None:
        return float(np.sum((fit.residual / present.rmse[:, None]) ** 2))
    return float(np.sum(fit.in_white_noise().whitened[:, 0] ** 2))


def _name(place: _Place, present: Fit, effects: Mapping[str, Effect]) -> tuple[Fit, _Place]:
    """The fit with the causes of a place instead of its form, or with one cause beside it, and the place with these.

    If no effect of the catalogue takes up most of the form, the fit stays as it is. Several effects are causes only if
    no form is needed beside them: together they follow nearly any curve.
    """
    without = refit(present, present.model.without(f"{PREFIX}{place.name}"))
    curve = _squares(without, present) - _squares(present, present)
    chosen: list[tuple[RowCandidate, Fit]] = []
    rivals: dict[str, tuple[str, ...]] = {}
    while len(chosen) < MOST_NAMES:
        best = chosen[-1][1] if chosen else without
        ranked = candidates(best, effects)
        if chosen:  # further effects are part of the same mechanism
            ranked = [c for c in ranked if place_of_effect(c.name) == place.name]
            ranked = [c for c in ranked if not any(_is_nested(c.effect, other.effect) for other, _ in chosen)]
        trials = [(c, refit_with(best, c)) for c in _worth_a_fit(ranked, place.name)]
        trials = [(c, trial) for c, trial in trials if not loses_parameters(best, trial)]
        complete = [(c, trial) for c, trial in trials if _is_complete(trial, present, place.name)]
        if complete:
            last, end = _likeliest(complete, present)
            causes = (*(c.name for c, _ in chosen), last.name)
            rivals[last.name] = with_rivals(last, ranked, best).indistinguishable_from
            return end, replace(place, causes=causes, share=1.0, rivals=(), rivals_of_causes=rivals)
        at_place = [(c, trial) for c, trial in trials if place_of_effect(c.name) == place.name]
        least = (NEXT_FORM if chosen else FIRST_FORM) * curve
        before = _squares(best, present)
        at_place = [(c, trial) for c, trial in at_place if before - _squares(trial, present) >= least]
        if not at_place:
            break
        chosen.append(_likeliest(at_place, present, NEXT_FORM * curve))
        rivals[chosen[-1][0].name] = place.rivals
    share = (_squares(without, present) - _squares(chosen[0][1], present)) / curve if chosen else 0.0
    if share < NAMED:
        return present, place
    cause, beside = chosen[0]
    end = refit(beside, beside.model.with_effect(RequestedForm(place.name)))
    return end, replace(place, causes=(cause.name,), share=share, rivals_of_causes={cause.name: place.rivals})


def _is_nested(effect: Effect, other: Effect) -> bool:
    """Whether one of two effects is a wider form of the other: one mechanism."""
    return other.name in effect.contains or effect.name in other.contains


def _worth_a_fit(ranked: Sequence[RowCandidate], place: str) -> list[RowCandidate]:
    """The first candidates, and all of a place."""
    likely = [c for c in ranked[:TRIALS] if c.p_value < SIGNIFICANT]
    return [*likely, *(c for c in ranked if c.name in EFFECTS_AT.get(place, ()) and c not in likely)]


def _is_complete(trial: Fit, with_form: Fit, place: str) -> bool:
    """Whether a fit is as good as that with the form of this place, and the rows show no such form beside it."""
    most = MATERIAL**2 * max(float(trial.residual.size), _squares(with_form, with_form))
    return _squares(trial, with_form) < most and not _acting_forms(trial, [place]).by_place


def _likeliest(
    trials: Sequence[tuple[RowCandidate, Fit]], present: Fit, clearly: float = CLEARLY_BETTER
) -> tuple[RowCandidate, Fit]:
    """The likeliest effect with its fit; one that it contains, where the wider one is not `clearly` better."""
    price = float(np.log(trials[0][1].residual.size))
    costs = {c.name: _squares(trial, present) + price * c.rank for c, trial in trials}
    best = min(trials, key=lambda trial: costs[trial[0].name])
    inner = [(c, trial) for c, trial in trials if c.name in best[0].effect.contains]
    as_good = [(c, trial) for c, trial in inner if costs[c.name] < costs[best[0].name] + clearly]
    return min(as_good, key=lambda trial: costs[trial[0].name], default=best)


def _as_search(
    start: Fit, base: Fit, end: Fit, places: Sequence[_Place], effects: Mapping[str, Effect]
) -> StructuralSearch:
    """The search with a step for each effect that the end needs."""
    linear = [name for name in (*BASIC, *GEOMETRY) if base.model.holds(name) and not start.model.holds(name)]
    basic = [name for name in linear if name in BASIC and _is_needed(end, start, name)]
    geometry = [name for name in linear if name in GEOMETRY and _is_needed(end, start, name)]
    if len(basic) + len(geometry) < len(linear):
        end = refit(end, _as_in(start, end, [name for name in linear if name not in (*basic, *geometry)]))
    base = fit_each_axis(start, basic, effects)
    causes = [cause for place in places for cause in place.causes]
    by_name = {term.name: term.effect for term in end.model.terms}
    forms = [name for name in by_name if name.startswith(PREFIX) and not start.model.holds(name)]
    added = at_values_of(end, [Addition(by_name[name]) for name in (*geometry, *causes, *forms)])
    selected, fits = fit_one_by_one(base, added, end)
    found = StructuralSearch.of_fits(start, basic, selected, fits, effects)
    acting = _acting_places(end, places)
    # few attitudes of a motion do not tell geometry from what a place adds in proportion to the force
    unknown = max((place.size for place in acting if place.unknown), default=0.0)
    visible = [name for name in geometry if _size(end, [name]) >= LINEAR_PART * unknown and not start.table.type.moving]
    rivals = {cause: names for place in places for cause, names in place.rivals_of_causes.items() if names}
    return replace(found, places=acting, named=(*causes, *visible), rivals=rivals)


def _as_in(start: Fit, end: Fit, names: Sequence[str]) -> Model:
    """The model of `end` with these effects as the model of `start` has them: for all axes alike, or not at all."""
    model = reduce(Model.without, names, end.model)
    return replace(model, terms=(*(term for term in start.model.terms if term.name in names), *model.terms))


def _is_needed(end: Fit, start: Fit, name: str) -> bool:
    """Whether the rows show an effect; one that the given model has for all axes alike, that the axes differ."""
    tied = any(term.name == name for term in start.model.terms)
    return chance(*first_order_cost(end, name, shared=tied)) < SIGNIFICANT


def _acting_places(end: Fit, places: Sequence[_Place]) -> tuple[ActingPlace, ...]:
    """The places with their sizes in the last fit, the largest first."""
    names = {place.name: _effects_of(end, place) for place in places}
    sizes = {name: _size(end, effects) for name, effects in names.items()}
    largest, rows = max(sizes.values()), CurveRows.of(end)
    acting = [
        ActingPlace(
            place.name, sizes[place.name], sizes[place.name], largest, (), place.causes, place.share, True,
            place.gain, place.rivals, rows.contribution(names[place.name]),
        )
        for place in places
    ]  # fmt: skip
    return tuple(sorted(acting, key=lambda place: -place.size))


def _effects_of(end: Fit, place: _Place) -> list[str]:
    """The effects of the model that describe a place."""
    form = f"{PREFIX}{place.name}"
    return [term.name for term in end.model.terms if term.name in (*place.causes, form)]


def _size(end: Fit, names: Sequence[str]) -> float:
    """Rms of what effects contribute beyond bias, scale factor and geometry, in noise floors."""
    steps = end.problem.layout.steps(end.theta)
    others = [step for step in steps if step[0].name not in names]
    change = end.in_white_noise().noise.whiten((end.problem.residual_by(others) - end.residual)[:, :, None])[:, 0]
    linear = np.any([end.problem.layout.of_effect(name) for name in (*BASIC, *GEOMETRY) if name not in names], axis=0)
    base = end.in_white_noise().whitened[:, 1:][:, linear]
    base = base / np.maximum(np.linalg.norm(base, axis=0), 1e-300)
    return float(rms(change - base @ np.linalg.lstsq(base, change, rcond=1e-9)[0]))
