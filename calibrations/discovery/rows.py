"""Tables of rows in the loop: poses, positions, fields, rates and motion.

An effect whose loss would cost little beside the loss of the greatest is a refinement: it corrects the form in which
another acts, known only approximately, and is not named as a cause. Geometry is exact: a strong misalignment makes
nothing else a refinement.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from calibrations.criteria import (
    FEWEST_FOR_FLOOR,
    FEWEST_FOR_PLACES,
    LEAST_NOISE,
    MATERIAL,
    MOST_EFFECTS,
    MOST_UNEXPLAINED,
    NO_MORE_THAN_NOISE,
    WRONG_FLOOR,
)
from calibrations.design.experiment import separating_experiment
from calibrations.discovery.candidates import candidates, with_planned, with_rivals
from calibrations.discovery.dataset import Cells, Dataset
from calibrations.discovery.fit_doubts import fit_doubts
from calibrations.discovery.outliers import caution, fit_without, kept, told
from calibrations.discovery.places import places
from calibrations.discovery.plausibility import Finding, refusal, rejection
from calibrations.discovery.results import Candidate, Diagnosis, Discovery, Findings, Place, Step
from calibrations.discovery.search import Path, Settled, find_path, is_complete, recounted, settled
from calibrations.discovery.structure import plainer, structure_of
from calibrations.discovery.summary import step_shares
from calibrations.discovery.verdict import Verdict
from calibrations.effects import Effect
from calibrations.effects.expression_effect import effect_for
from calibrations.errors import ModelError, nearest
from calibrations.fitting.determined import blind_to, undetermined
from calibrations.fitting.fit import Fit, evaluate, fit, refit
from calibrations.fitting.sensed import axis_of, milli_unit, pooled_milli
from calibrations.free_forms.place_names import PREFIX, place_of_effect, shown_at_rest
from calibrations.geometry.orientation import one_orientation
from calibrations.means.noise import correlation_known, rms
from calibrations.model import Model
from calibrations.table import NUMBERS, Array, Table
from calibrations.text import quantity, rounded, sentence

if TYPE_CHECKING:
    from calibrations.discovery.enough import Enough
    from calibrations.discovery.structural import StructuralSearch
    from calibrations.model.correlations import Correlations
    from calibrations.presentation.chart import Chart, Picture

ONE_ORIENTATION = (
    "all rows have one orientation, which shows the bias, and not the scale factor, the geometry or any other response "
    "to the specific force; to calibrate these, measure at several inclinations and turns, as `rig run sweep` does"
)
INFLUENCES = ("temperature_c", "supply_v", "t_s")  # that a product may know


@dataclass(frozen=True, eq=False)
class Rows(Dataset[Fit]):
    """A table whose rows are fitted by least squares."""

    table: Table

    form = "rows"
    floor = "the noise floor"
    complete = "The model fails nowhere: the residual is noise."

    @property
    def default_model(self) -> str:  # type: ignore[override]
        """The shipped model for this content."""
        return self.table.type.default_model

    @property
    def unseen(self) -> str:  # type: ignore[override]
        """Rows that a fit did not use."""
        return f"unseen {self.table.type.rows}"

    @property
    def source(self) -> str:
        """File or run."""
        return self.table.source

    @property
    def content(self) -> str:
        """The kind of data, as models are defined for it."""
        return self.table.content

    @property
    def n(self) -> int:
        """Rows."""
        return self.table.n

    @property
    def unit(self) -> str:
        """Unit of the outputs."""
        return self.table.unit

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes that were measured."""
        return self.table.axes

    @property
    def description(self) -> str:
        """Rows and source."""
        return f"{self.table.n} {self.table.type.size_in} of {self.table.source}"

    @property
    def note(self) -> str:
        """That of a motion: the report also shows the models of its sweep."""
        return self.table.type.note

    @property
    def left_out(self) -> tuple[str, ...]:
        """Places of the signal chain in which no search looks for a cause."""
        return self.table.left_out

    def without(self, places: Sequence[str]) -> Rows:
        """The same table for a search that leaves out these places. Raises ModelError for an unknown place."""
        if not places:
            return self
        from calibrations.free_forms.effect import place_to_leave_out  # few searches leave out a place

        chosen = tuple(dict.fromkeys(place_to_leave_out(place) for place in places))
        for place in chosen:
            column = place.removeprefix("column:")
            if column not in (place, "std", *self.table.columns):
                hint = nearest(column, self.table.columns)
                raise ModelError(f"{place} cannot be left out: {self.source} has no column {column}{hint}")
        return Rows(replace(self.table, left_out=chosen))

    def _searchable(self, effects: Mapping[str, Effect]) -> Mapping[str, Effect]:
        """The effects that act at none of the places that are left out; at one orientation those that it can show."""
        if self.at_rest:
            effects = {name: effect for name, effect in effects.items() if shown_at_rest(name)}
        return {name: effect for name, effect in effects.items() if place_of_effect(name) not in self.left_out}

    @property
    def at_rest(self) -> bool:
        """Whether all poses have one orientation."""
        return one_orientation(self.table)

    def fit(self, model: Model) -> Fit:
        """Least squares. Raises what `fit` raises."""
        return fit(model, self.table)

    def evaluate(self, model: Model) -> Fit | None:
        """The model with its values."""
        return evaluate(model, self.table)

    def noise_known(self, found: Fit) -> bool:
        """Whether it follows from the samples of each row."""
        return found.noise.known

    def places(self, found: Fit) -> tuple[Place, ...]:
        """Stretches of columns."""
        return places(found)

    def search(self, model: Model, effects: Mapping[str, Effect]) -> Findings[Fit]:
        """One effect if it explains all, else places that act and their causes; of other kinds forward steps."""
        if (reason := refusal(self.table)) is not None:
            return self._rejected(self.fit(model), reason)
        start, outliers = fit_without(model, self.table)
        return self._searched(start, outliers, start, effects)

    def search_on(self, start: Fit, origin: Fit, effects: Mapping[str, Effect]) -> Findings[Fit]:
        """The same from a fitted model."""
        return self._searched(start, self._left_out(start), origin, effects)

    def _searched(
        self, start: Fit, outliers: tuple[int, ...], origin: Fit, effects: Mapping[str, Effect]
    ) -> Findings[Fit]:
        effects = self._searchable(effects)
        found = self._searched_among(start, outliers, origin, effects)
        remarks = [f"Places left out of the search: {', '.join(self.left_out)}."] if self.left_out else []
        remarks += [sentence(ONE_ORIENTATION)] if self.at_rest else []
        return replace(found, remarks=(*found.remarks, *remarks))

    def _searched_among(
        self, start: Fit, outliers: tuple[int, ...], origin: Fit, effects: Mapping[str, Effect]
    ) -> Findings[Fit]:
        path = find_path(start, outliers, effects, most=1 if self.shows_places else MOST_EFFECTS)
        if not self.shows_places or _explained(path):
            return self._found(path, effects, origin)
        from calibrations.discovery.structural import search_structure  # only this search needs it

        searched = search_structure(start, effects)
        if searched.steps and path.steps and _unseen_error(path.end) <= _unseen_error(searched.end):
            return self._found(path, effects, origin)  # what needs more must foretell more
        found = self._with_structure(searched, outliers, searched.start if origin is start else origin)
        if not (found.steps or path.steps) and structure_of(path.end) is None:
            return self._found(path, effects, origin)  # the slow noise of a sensor looks like a pattern in white noise
        return found

    @property
    def shows_places(self) -> bool:
        """Whether the rows can show where in the signal chain something acts: enough poses at known angles.

        Slow noise that is known from a still record is not yet among what that search can take for given.
        """
        return self.table.type.stage_angles and self.table.n >= FEWEST_FOR_PLACES and not self.table.noise

    def until(self, found: Findings[Fit], enough: Enough) -> Findings[Fit]:
        """The findings up to the first model whose error on unseen rows is small enough. Raises ModelError."""
        from calibrations.discovery.enough import until  # few searches stop before their end

        return until(found, enough)

    def candidates(self, before: Fit, plan: Findings[Fit], effects: Mapping[str, Effect]) -> tuple[Candidate, ...]:
        """One round of the search, the next effect of the plan first."""
        found = candidates(before, effects)
        return tuple(with_planned(found, plan.steps[0]) if plan.steps else found)

    def beginning(self, model: Model) -> tuple[Rows, Fit]:
        """(the table without gross outliers, the model fitted to it)."""
        start, outliers = fit_without(model, self.table)
        return (Rows(start.table) if outliers else self), start

    def _left_out(self, found: Fit) -> tuple[int, ...]:
        """Numbers of the rows that a fit leaves out."""
        if not self.table.type.stage_angles:
            return ()
        every = np.arange(self.table.n)
        kept = found.table.numbered(np.arange(found.table.n))
        return tuple(map(int, np.setdiff1d(self.table.numbered(every), kept)))

    def undetermined(self, found: Fit) -> str | None:
        """Why a small residual proves nothing on these data."""
        return undetermined(found)

    def untestable(self, found: Fit, effects: Mapping[str, Effect]) -> str | None:
        """The effects that these data cannot show together with the model."""
        hidden = blind_to(found, effects)
        if not hidden:
            return None
        if self.at_rest:
            return None  # the verdict and the cautions say it for all effects of the force
        angles = found.table.column("alpha_deg") if found.table.type.stage_angles else np.arange(2.0)
        one = f" The data has only one inclination, alpha = {angles[0]:g} deg; measure at other inclinations."
        return (
            f"With the model {found.model.name}, these effects cannot be tested on this data: {', '.join(hidden)}."
            f"{'' if np.ptp(angles) else one}"
        )

    def expression(self, name: str, text: str) -> Effect:
        """An effect of one's own on the columns of this table."""
        return effect_for(name, text, self.table)

    @property
    def foreseeable(self) -> bool:
        """Of poses, whose angles are planned."""
        return self.table.type.stage_angles

    def figures(self, found: Fit) -> dict[str, str]:
        """Error, held-out error and noise floor."""
        (error, floor), unit = pooled_milli(found), milli_unit(found)
        return {
            "error": f"{rounded(found.pooled_excess)} × ({rounded(error, 2)} {unit})",
            f"on {self.unseen}": f"{rounded(found.held_out_excess)} ×",
            "noise floor": f"{rounded(floor, 2)} {unit}",
        }

    def facts(self, candidate: Candidate, result: Diagnosis[Fit]) -> dict[str, str]:
        """Error on the rows of the fit, and on unseen rows."""
        kind = self.table.type.rows
        return {
            f"Error, {kind} of the fit": _fall(result.excess_before, candidate.excess_after),
            f"Error, unseen {kind}": _fall(result.held_out_before, candidate.held_out_after),
        }

    def _found(self, path: Path, effects: Mapping[str, Effect], origin: Fit | None = None) -> Findings[Fit]:
        stand = settled(path, effects)
        path, stand = recounted(path, stand.end), replace(stand, end=stand.end.in_floor(stand.end.noise.scatter))
        if (reason := rejection(stand.end)) is not None:
            return self._rejected(path.start, reason)
        better = plainer(path.start, stand.end)
        structure = better or structure_of(stand.end)
        left = structure if stand.end.pooled_excess > MATERIAL else None
        steps = _in_order(path.start, stand, effects)
        named = _causes(steps, len(path.first))
        beside = {name: stand.beside[name].indistinguishable_from for name in named if name in stand.beside}
        rivals = {name: others for name, others in beside.items() if others}
        separations = {name: separating_experiment(name, others, self.table) for name, others in rivals.items()}
        found = Findings(
            data=self,
            start=path.start,
            origin=origin or path.start,
            baseline=path.start,
            steps=steps,
            candidates=_next_first(path, stand),
            causes=named,
            alternatives=rivals,
            left=left.text if left else None,
            pattern=left,
            spoilt=left is not None and better is not None,
            undetermined=(undetermined(path.start), undetermined(stand.end)),
            set_aside=caution(path.outliers),
            outliers=path.outliers,
            separations=separations,
            settled=stand.tested,
        )
        if steps and found.given.verdict is Verdict.UNEXPLAINED:
            return found.without_steps()
        if path.outliers and not steps and left is None:
            return replace(found, left=told(path.outliers), spoilt=True)
        return found

    def _with_structure(self, searched: StructuralSearch, outliers: tuple[int, ...], origin: Fit) -> Findings[Fit]:
        start, end = searched.start, searched.end
        if (reason := rejection(end)) is not None:
            return self._rejected(start, reason)
        better = plainer(start, end, searched.causes_alone if searched.causes else None)
        left = better or (structure_of(end) if end.pooled_excess > MATERIAL else None)
        if left is None and any(place.unknown for place in searched.structure.places):
            left = structure_of(searched.causes_alone)
        rivals = searched.alternatives
        known = {c.name for c in searched.candidates}
        separations = {
            name: separating_experiment(name, tuple(o for o in others if o in known), self.table)
            for name, others in rivals.items()
            if known & set(others)
        }
        found = Findings(
            data=self,
            start=start,
            origin=origin,
            baseline=start,
            steps=searched.steps,
            candidates=searched.candidates,
            causes=searched.causes,
            alternatives=rivals,
            places=searched.structure.places,
            left=left.text if left else None,
            pattern=left,
            spoilt=better is not None,
            undetermined=(undetermined(start), undetermined(end)),
            set_aside=caution(outliers),
            outliers=outliers,
            separations=separations,
            remarks=searched.remarks,
        )
        spoilt = better is not None or (found.final.share_left > MOST_UNEXPLAINED and not found.final.unknown)
        if searched.steps and spoilt:
            return found.without_steps()
        if outliers and not searched.steps and left is None:
            return replace(found, left=told(outliers), spoilt=True)
        return found

    def _rejected(self, start: Fit, reason: Finding) -> Findings[Fit]:
        """Data in which no effect can be searched for."""
        return Findings(
            data=self, start=start, origin=start, baseline=start, left=reason.text, spoilt=True,
            unresponsive=reason.verdict == Verdict.NO_RESPONSE,
        )  # fmt: skip

    def rejection(self, found: Fit) -> Finding | None:
        """What speaks against these poses, or against the values of a fit."""
        return rejection(found)

    def covered(self, found: Fit) -> dict[str, tuple[float, float]]:
        """Those of every sensor, and the model's own."""
        table = found.table
        own = {name for term in found.model.terms for name in term.effect.needs if name not in NUMBERS}
        there = [name for name in (*INFLUENCES, *sorted(own)) if name in table and table.n]
        return {name: (float(table.column(name).min()), float(table.column(name).max())) for name in there}

    def correlations(self, found: Fit) -> Correlations | None:
        """Those of the identified parameters, by the noise; of a large free form, without its coefficients."""
        from calibrations.model.correlations import MOST, Correlations  # only what writes a model needs them

        known = {key: e for key, e in found.params.items() if e.identified and e.std}
        if len(known) > MOST:
            whole = [e for term in found.model.terms for e in term.quantities]
            known = {key: e for key, e in known.items() if any(e is each for each in whole)}
        if not 1 < len(known) <= MOST:
            return None
        places = [k for k, key in enumerate(found.params) if key in known]
        return Correlations.of(list(known), found.correlation[np.ix_(places, places)])

    def addition(self, effect: Effect, model: Model, effects: Mapping[str, Effect]) -> Findings[Fit]:
        """One effect, with what the data cannot separate from it."""
        before, outliers = fit_without(model, self.table)
        before = before.in_floor(before.noise.floor)
        found = candidates(before, effects)
        own = next((with_rivals(c, found, before) for c in found if c.name == effect.name), None)
        rivals = own.indistinguishable_from if own is not None else ()
        step = self.step(effect, before)
        left = structure_of(step.after) if step.after.pooled_excess > MATERIAL else None
        if (reason := rejection(step.after)) is not None:
            return replace(self._rejected(step.before, reason), steps=(step,))
        return Findings(
            data=self,
            start=step.before,
            origin=step.before,
            baseline=step.before,
            steps=(step,),
            candidates=tuple(found),
            causes=(effect.name,),
            alternatives={effect.name: rivals} if rivals else {},
            left=left.text if left else None,
            pattern=left,
            undetermined=(undetermined(step.before), undetermined(step.after)),
            set_aside=caution(outliers),
            outliers=outliers,
            searched=False,
        )

    def step(self, effect: Effect, before: Fit) -> Step[Fit]:
        """The effect added; both errors are counted in one floor. Raises ModelError where it adds nothing."""
        after = refit(before, before.model.with_effect(effect))
        if effect.expression:
            _require_new(after, effect.name, before.model.name)
        floor = after.noise.scatter
        return Step(effect.name, before.in_floor(floor), after.in_floor(floor))

    def in_one_floor(self, start: Fit, steps: tuple[Step[Fit], ...]) -> tuple[Fit, tuple[Step[Fit], ...]]:
        """All errors in what the last model leaves, where that is the only measure of noise."""
        floor = (steps[-1].after if steps else start).noise.scatter
        return start.in_floor(floor), tuple(
            replace(step, before=step.before.in_floor(floor), after=step.after.in_floor(floor)) for step in steps
        )

    def require_allowed(self, effect: Effect) -> None:
        """Raises ModelError where the table lacks a column, or the effect is defined for another kind."""
        if (why := effect.excluded(self.table)) is not None:
            t = self.table
            if effect.name.startswith(PREFIX) and t.content in effect.kinds:
                raise ModelError(f"{effect.name} {why} ({t.source})")
            raise ModelError(f"{effect.name} {why}; {t.source} is a table of {t.kind}: {', '.join(t.columns)}")

    def errors_document(self, found: Fit) -> dict[str, Any]:
        """rmse, noise floor, slow noise and excess by axis."""
        return {
            "rmse": _by_axis(found, found.rmse),
            "noise_floor": _by_axis(found, found.noise.floor),
            "slow_noise": _by_axis(found, found.noise.slow),
            "excess": _by_axis(found, found.excess),
        }

    def error_table(self, found: Fit) -> Cells:
        """Residual, noise floor and slow noise of each channel."""
        unit = found.problem.unit
        rows = [
            (
                channel,
                quantity(found.rmse[c], unit),
                quantity(found.noise.floor[c], unit),
                quantity(found.noise.slow[c], unit),
                f"{found.excess[c]:.2f}",
            )
            for c, channel in enumerate(found.channels)
        ]
        floor = "noise floor" if found.noise.known else "scatter (noise floor not known)"
        return ("axis", "rms error", floor, "slow noise", "error / floor"), rows

    def step_table(self, found: Discovery[Fit]) -> Cells:
        """The error of each model, with bars."""
        fits = [(found.start.model.name, found.start), *((f"+ {s.name}", s.after) for s in found.steps)]
        shares = ["", *("-" if share is None else f"{100 * share:.1f} %" for share in step_shares(found))]
        rows = [
            (name, f"{each.pooled_excess:.2f}", f"{each.held_out_excess:.2f}", share, _bar(each, found.start))
            for (name, each), share in zip(fits, shares, strict=True)
        ]
        return ("model", "error / floor", self.unseen, "share", ""), rows

    def candidate_table(self, result: Diagnosis[Fit], candidates: Sequence[Candidate]) -> Cells:
        """Held-out error, chance and probability of each candidate."""
        chance = "if it is one of these" if result.verdict is Verdict.UNEXPLAINED else "probability"
        rows = [
            (
                c.name,
                f"{result.held_out_before:.3g} -> {c.held_out_after:.3g}",
                f"{c.p_value:.1g}",
                f"{c.probability:.3f}",
                ", ".join(c.indistinguishable_from) or "-",
            )
            for c in candidates
        ]
        return ("candidate", f"error on {self.unseen} / floor", "p-value", chance, "cannot be separated from"), rows

    def fit_chart(self, found: Fit) -> Chart:
        """The residual."""
        from calibrations.presentation.charts.fit import residual_chart

        return residual_chart(found)

    def steps_chart(self, found: Discovery[Fit]) -> Chart:
        """Error by model."""
        from calibrations.presentation.charts.discovery import levels, waterfall

        return waterfall(levels(found))

    def fit_album(self, found: Fit) -> list[Picture]:
        """Measurement and model, the residual, and its pattern."""
        from calibrations.presentation.charts.fit import fit_album

        return fit_album(found)

    def steps_album(self, found: Discovery[Fit]) -> list[Picture]:
        """Error by model, each effect's curve, and the curves of places."""
        from calibrations.presentation.charts.discovery import steps_album

        return steps_album(found)

    def remarks(self, found: Fit) -> list[str]:
        """A residual below the noise floor, which only a wrong floor leaves."""
        if not found.noise.known or found.pooled_excess > WRONG_FLOOR or found.table.n < FEWEST_FOR_FLOOR:
            return []
        return ["The error is smaller than the noise floor: check the standard deviations and n of these means."]

    def cautions(self, found: Fit) -> list[str]:
        """Why a fit of all rows may mislead: a model that the data do not determine, rows that stand out."""
        one = ONE_ORIENTATION if self.at_rest else None
        return [*filter(None, (one, undetermined(found), kept(found))), *self.doubts(found)]

    def doubts(self, found: Fit) -> list[str]:
        """Noise that is stated wrongly, and parameters that no sensor has."""
        return list(fit_doubts(found))


def _explained(path: Path) -> bool:
    """Whether the effects of a path leave no more and no less than the noise of the samples, and no pattern.

    Where the samples of a mean may be correlated, more than their noise may be left. Not at one orientation: a lag of
    the temperature looks like a hysteresis in slow noise.
    """
    end = path.end
    most = NO_MORE_THAN_NOISE if correlation_known(end.table) or one_orientation(end.table) else np.inf
    as_noise = end.noise.known and LEAST_NOISE < end.pooled_excess < most
    return as_noise and structure_of(end) is None and is_complete(path)


def _unseen_error(found: Fit) -> float:
    """Rms error on unseen rows, in the output's unit: the floors of two fits may differ."""
    return found.held_out_excess * float(np.sqrt(np.mean(found.noise.floor**2)))


def _fall(before: float, after: float) -> str:
    return f"{rounded(before)} → {rounded(after)} × the noise floor"


def _next_first(path: Path, stand: Settled) -> tuple[Candidate, ...]:
    """Candidates on the given model; the first is the effect of the first step, with its alternatives."""
    first = path.first
    name = next((name for name in stand.names), None)
    own = next((c for c in first if c.name == name), None)
    if own is None:
        return first
    if name in stand.beside:
        own = replace(own, indistinguishable_from=stand.beside[own.name].indistinguishable_from)
    return own, *(c for c in first if c.name != name)


def _in_order(start: Fit, stand: Settled, effects: Mapping[str, Effect]) -> tuple[Step[Fit], ...]:
    """The effects one after another: first those that free a value that the model already has, then new ones."""
    freed = {term.name for term in start.model.terms}
    order = sorted(stand.names, key=lambda name: name not in freed)
    steps: list[Step[Fit]] = []
    present = start
    for name in order:
        last = len(steps) == len(order) - 1
        after = stand.end if last else refit(present, present.model.with_effect(effects[name]))
        steps.append(Step(name, present, after))
        present = after
    return tuple(steps)


def _causes(steps: tuple[Step[Fit], ...], tried: int) -> tuple[str, ...]:
    """The effects of a search that are causes; one alone is."""
    if len(steps) < 2:
        return tuple(step.name for step in steps)
    from calibrations.discovery.refinements import causes  # most searches end at one effect

    return causes(steps, tried)


def _require_new(found: Fit, name: str, model: str) -> None:
    """An expression has to add something that `model` does not have. Raises ModelError."""
    estimates = found.model.estimates(name)
    if all(e.std is None for e in estimates):
        e = estimates[0]
        where = f" of {e.axis}" if e.axis else ""
        raise ModelError(f"{name} changes nothing that {model} cannot already describe: {e.name}{where}: {e.why}")


def _by_axis(found: Fit, values: Array) -> dict[str, float]:
    """By axis; of the parts of a motion their root mean square."""
    by_axis: dict[str, list[float]] = {}
    for channel, value in zip(found.channels, np.asarray(values), strict=True):
        by_axis.setdefault(axis_of(channel), []).append(float(value))
    return {axis: each[0] if len(each) == 1 else float(rms(np.array(each))) for axis, each in by_axis.items()}


def _bar(found: Fit, first: Fit) -> str:
    """A bar as long as the logarithm of the error over the noise floor."""
    longest = float(np.log(max(first.pooled_excess, 1.1)))
    return "#" * max(1, round(40 * float(np.log(max(found.pooled_excess, 1.0))) / longest))
