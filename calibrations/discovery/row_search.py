"""The search in a table of rows: one effect if it explains all, else the places that act and their causes.

An effect is a refinement if its removal costs little compared with the removal of the greatest effect. It corrects the
form of another effect, which is known only approximately, and is not named as a cause. Geometry is exact: if the
greatest effect is a misalignment, no effect is a refinement.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from calibrations.criteria import (
    FEWEST_FOR_PLACES,
    LARGER_NOISE,
    LEAST_NOISE,
    MATERIAL,
    MOST_EFFECTS,
    MOST_UNEXPLAINED,
    MOST_UNSEEN,
    NO_MORE_THAN_NOISE,
)
from calibrations.discovery.candidates import candidates, named_first, with_rivals
from calibrations.discovery.findings import Candidate, Findings, Step
from calibrations.discovery.outliers import caution, outlier_text
from calibrations.discovery.plausibility import rejection
from calibrations.discovery.search import (
    FinalModel,
    Path,
    continue_path,
    final_model,
    find_path,
    in_final_floor,
    is_complete,
)
from calibrations.discovery.structure import find_competing_pattern, poorly_predicted, structure_of
from calibrations.discovery.verdict import Finding, Verdict
from calibrations.effects import Effect
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.determined import explain_undetermined
from calibrations.fitting.fit import Fit, fit, refit
from calibrations.free_forms.place_names import KINDS_OF_FORMS, is_visible_at_rest, place_of_effect
from calibrations.geometry.orientation import one_orientation
from calibrations.means.noise import correlation_known, neighbours_contradict, rms, with_white
from calibrations.progress import report
from calibrations.table import Array, Table
from calibrations.text import sentence

if TYPE_CHECKING:
    from calibrations.design.experiment import Experiment
    from calibrations.discovery.dataset import Dataset
    from calibrations.discovery.patterns import Pattern
    from calibrations.discovery.structural_search import StructuralSearch

SCATTER_IS_NOISE = (
    "The noise floor is the scatter of the poses. It is larger than the standard deviation and the number of samples "
    "of a mean say, as if the samples were correlated."
)
CLEARLY_WORSE = 1.5  # times the error of a model by effects alone, whose names are less reliable
ONE_ORIENTATION = (
    "all rows have one orientation, which shows the bias, and not the scale factor, the geometry or any other response "
    "to the specific force; to calibrate these, measure at several inclinations and turns, as `rig run sweep` does"
)


@dataclass(frozen=True)
class RowSearch:
    """A search among the rows of `data`, whose table is `table`."""

    data: Dataset[Fit]
    table: Table

    def findings(
        self, start: Fit, outliers: tuple[int, ...], origin: Fit, effects: Mapping[str, Effect]
    ) -> Findings[Fit]:
        """The effects that the model of `start` misses; `outliers` are the rows that its fit excludes."""
        effects = self._searchable(effects)
        findings = self._search_model(start, outliers, origin, effects)
        white, remarks = _white_with_scatter(findings), list[str]()
        caused = white is not None and self._has_cause(start, white)
        if caused:
            findings = self._search_model(start, outliers, origin, effects, always_places=True)
            white = _white_with_scatter(findings)
        if white is not None:
            report("searching with the scatter of the poses as their noise")
            scattered = fit(start.model, with_white(start.table, white))
            origin = scattered if origin is start else origin
            findings = self._search_model(scattered, outliers, origin, effects, always_places=caused)
            remarks.append(SCATTER_IS_NOISE)
        excluded_places = self.table.left_out
        remarks += [f"Places left out of the search: {', '.join(excluded_places)}."] if excluded_places else []
        remarks += [sentence(ONE_ORIENTATION)] if one_orientation(self.table) else []
        return replace(findings, remarks=(*findings.remarks, *remarks))

    def rejected(self, start: Fit, reason: Finding) -> Findings[Fit]:
        """Findings for data that cannot be searched for effects, for this reason."""
        return Findings(
            data=self.data, start=start, origin=start, baseline=start, left=reason.text, spoilt=True,
            unresponsive=reason.verdict == Verdict.NO_RESPONSE,
        )  # fmt: skip

    def addition(
        self, effect: Effect, start: Fit, outliers: tuple[int, ...], effects: Mapping[str, Effect]
    ) -> Findings[Fit]:
        """One chosen effect, with the effects that the data cannot separate from it."""
        base = start.in_floor(start.noise.floor)
        step = self.data.step(effect, base)
        if (reason := rejection(step.after)) is not None:
            return replace(self.rejected(step.before, reason), steps=(step,))
        ranked = candidates(base, effects)
        candidate = next((with_rivals(c, ranked, base) for c in ranked if c.name == effect.name), None)
        rivals = candidate.indistinguishable_from if candidate is not None else ()
        return self._findings(
            step.before, step.after, outliers, _material_structure(step.after),
            steps=(step,),
            candidates=tuple(ranked),
            causes=(effect.name,),
            alternatives={effect.name: rivals} if rivals else {},
            searched=False,
        )  # fmt: skip

    def _has_cause(self, start: Fit, scatter: Array) -> bool:
        """Whether places explain a part of the `scatter` of the poses, (channels, n).

        In poses in random order, the sign of what follows the time or the force changes from pose to pose.
        """
        if not self._shows_places:
            return False
        from calibrations.discovery.structural import residual_beside_places  # only this search needs it

        report("searching for a cause of the scatter of the poses")
        return residual_beside_places(fit(start.model, with_white(start.table, scatter))) < LEAST_NOISE

    def _searchable(self, effects: Mapping[str, Effect]) -> Mapping[str, Effect]:
        """The effects at places that are not excluded; at one orientation, only those that the data can show."""
        if one_orientation(self.table):
            effects = {name: effect for name, effect in effects.items() if is_visible_at_rest(name)}
        return {name: effect for name, effect in effects.items() if place_of_effect(name) not in self.table.left_out}

    def _search_model(
        self,
        start: Fit,
        outliers: tuple[int, ...],
        origin: Fit,
        effects: Mapping[str, Effect],
        always_places: bool = False,
    ) -> Findings[Fit]:
        """The findings beyond the model of `start`; `always_places`: also where its residual looks like noise."""
        few_steps = self._shows_places or self._shows_forms
        path = find_path(start, outliers, effects, max_steps=1 if few_steps else MOST_EFFECTS)
        if self.table.type.moving:
            if find_competing_pattern(path.start, path.end) is not None:
                return self._path_findings(path, effects, origin)
            path = continue_path(path, effects)
        if self._shows_places and (own_names := effects.keys() - catalogue().keys()):
            further = continue_path(path, effects)  # the structural search knows no place for the user's effects
            path = further if own_names & {step.selected.name for step in further.steps} else path
        explained = _is_explained(path) and not always_places
        if self._shows_forms and not (explained and path.end.pooled_excess < NO_MORE_THAN_NOISE):
            return self._findings_without_stages(path, outliers, effects, origin)
        if not self._shows_places or explained:
            return self._path_findings(path, effects, origin)
        from calibrations.discovery.structural import search_structure  # only this search needs it

        structural = search_structure(start, effects, path.ranked if start.noise.known else ())
        if structural.steps and path.steps and _cross_validated(path.end) <= _cross_validated(structural.end):
            return self._path_findings(path, effects, origin)  # the larger model must predict better
        if structural.end.held_out_excess > MATERIAL:
            report("adding effects of the catalogue one after another")
            further = continue_path(path, effects)
            if CLEARLY_WORSE * _cross_validated(further.end) < _cross_validated(structural.end):
                return self._path_findings(further, effects, origin, structural.causes)
        origin = structural.start if origin is start else origin.in_floor(structural.end.noise.floor)
        findings = self._structural_findings(structural, outliers, origin)
        if not (findings.steps or path.steps) and structure_of(path.end) is None:
            return self._path_findings(path, effects, origin)  # slow noise looks like a pattern in white noise
        return findings

    def _findings_without_stages(
        self, path: Path, outliers: tuple[int, ...], effects: Mapping[str, Effect], origin: Fit
    ) -> Findings[Fit]:
        """The findings of the search that predicts better: that for places, or the one that adds effects."""
        if self.table.type.moving and path.end.held_out_excess <= MOST_UNSEEN:
            return self._path_findings(path, effects, origin)
        from calibrations.discovery.place_search import search_places  # few data need it

        found = search_places(path.start, effects)
        if found is None or found.end.pooled_excess > MATERIAL:
            path = continue_path(path, effects)
        if found is None or not _predicts_better(found.end, path.end):
            return self._path_findings(path, effects, origin)
        return self._structural_findings(found, outliers, origin)

    @property
    def _shows_forms(self) -> bool:
        """Whether free forms exist for these rows, though no stages gave them their angles."""
        return self.table.content in KINDS_OF_FORMS and not self.table.type.stage_angles

    @property
    def _shows_places(self) -> bool:
        """Whether the rows can show at which place of the signal chain an effect acts: enough poses at known angles.

        The structural search does not support slow noise from a still record yet.
        """
        return self.table.type.stage_angles and self.table.n >= FEWEST_FOR_PLACES and not self.table.noise

    def _path_findings(
        self, path: Path, effects: Mapping[str, Effect], origin: Fit, acting: Collection[str] = ()
    ) -> Findings[Fit]:
        """The findings of a search that adds effects; `acting`: causes of a search for places, which confirms them."""
        final = final_model(path, effects)
        path, final = in_final_floor(path, final.end), replace(final, end=final.end.in_floor(final.end.noise.scatter))
        if (reason := rejection(final.end)) is not None:
            return self.rejected(path.start, reason)
        pattern = find_competing_pattern(path.start, final.end)
        steps = _order_steps(path.start, final, effects)
        needed = _causes(steps, len(path.first))
        causes = tuple(step.name for step in steps if step.name in needed or step.name in acting)
        inseparable = {
            name: final.effect_candidates[name].indistinguishable_from
            for name in causes
            if name in final.effect_candidates
        }
        rivals = {name: names for name, names in inseparable.items() if names}
        remainder = (pattern or structure_of(final.end)) if final.end.pooled_excess > MATERIAL else None
        remainder = remainder or poorly_predicted(final.end)
        findings = self._findings(
            path.start, final.end, path.outliers, remainder,
            origin=origin,
            steps=steps,
            candidates=_start_candidates(path, final),
            causes=causes,
            alternatives=rivals,
            spoilt=remainder is not None and pattern is not None,
            separations=self._separations(rivals),
            settled=final.tested,
        )  # fmt: skip
        if steps and findings.given.verdict is Verdict.UNEXPLAINED:
            return findings.without_steps()
        return _with_outliers(findings)

    def _structural_findings(
        self, structural: StructuralSearch, outliers: tuple[int, ...], origin: Fit
    ) -> Findings[Fit]:
        start, end = structural.start, structural.end
        if (reason := rejection(end)) is not None:
            return self.rejected(start, reason)
        pattern = find_competing_pattern(start, end, structural.causes_alone if structural.causes else None)
        remainder = pattern or _material_structure(end) or poorly_predicted(end)
        if remainder is None and any(place.unknown for place in structural.places):
            remainder = structure_of(structural.causes_alone)
        candidate_names = {c.name for c in structural.candidates}
        findings = self._findings(
            start, end, outliers, remainder,
            origin=origin,
            steps=structural.steps,
            candidates=structural.candidates,
            causes=structural.causes,
            alternatives=structural.alternatives,
            places=structural.places,
            spoilt=pattern is not None,
            separations=self._separations(
                {
                    name: tuple(rival for rival in rivals if rival in candidate_names)
                    for name, rivals in structural.alternatives.items()
                    if candidate_names & set(rivals)
                }
            ),
            remarks=structural.remarks,
        )  # fmt: skip
        spoilt = pattern is not None or (findings.final.share_left > MOST_UNEXPLAINED and not findings.final.unknown)
        if structural.steps and spoilt:
            return findings.without_steps()
        return _with_outliers(findings)

    def _separations(self, rivals: Mapping[str, tuple[str, ...]]) -> dict[str, Experiment]:
        """By effect, the experiment that separates it from the others."""
        if not rivals:
            return {}
        from calibrations.design.experiment import separating_experiment  # few effects have rivals

        return {name: separating_experiment(name, names, self.table) for name, names in rivals.items()}

    def _findings(
        self, start: Fit, end: Fit, outliers: tuple[int, ...], remainder: Pattern | None, **members: Any
    ) -> Findings[Fit]:
        """The findings with the members common to every search; `members` are those that differ."""
        common: dict[str, Any] = {
            "origin": start,
            "left": remainder.text if remainder else None,
            "pattern": remainder,
            "undetermined": (explain_undetermined(start), explain_undetermined(end)),
            "set_aside": caution(outliers),
            "outliers": outliers,
        }
        return Findings(data=self.data, start=start, baseline=start, **common | members)


def _white_with_scatter(findings: Findings[Fit]) -> Array | None:
    """The noise of each mean with the scatter of the poses, (channels, n), if that is the larger part of it; else None.

    Means of correlated samples scatter more than their samples say, and only the filter would tell how much. Scatter
    beside an unexplained part may belong to it.
    """
    table, noise = findings.end.table, findings.end.noise
    explained = findings.final.verdict in (Verdict.ADEQUATE, Verdict.AMBIGUOUS)
    if not table.type.stage_angles or correlation_known(table) or not noise.known or not explained:
        return None
    return noise.fast if np.any(rms(noise.fast) > LARGER_NOISE * rms(noise.white)) else None


def _with_outliers(findings: Findings[Fit]) -> Findings[Fit]:
    """The findings with the outliers as the unexplained part, if there is no other effect or pattern."""
    if findings.outliers and not findings.steps and findings.left is None:
        return replace(findings, left=outlier_text(findings.outliers), spoilt=True)
    return findings


def _material_structure(end: Fit) -> Pattern | None:
    """The pattern of a residual that is more than noise."""
    return structure_of(end) if end.pooled_excess > MATERIAL else None


def _is_explained(path: Path) -> bool:
    """Whether the residual of a path has the size of the samples' noise, and no pattern.

    If the samples of a mean may be correlated, the residual may be larger than their noise. At one orientation it may
    not: there, a lag of the temperature looks like a hysteresis in slow noise.
    """
    end = path.end
    largest_excess = NO_MORE_THAN_NOISE if correlation_known(end.table) or one_orientation(end.table) else np.inf
    as_noise = end.noise.known and LEAST_NOISE < end.pooled_excess < largest_excess
    if not as_noise or (np.all(end.noise.white > 0) and neighbours_contradict(end.residual / end.noise.white)):
        return False
    return structure_of(end) is None and is_complete(path)


def _predicts_better(places: Fit, effects: Fit) -> bool:
    """Whether the model with places has the smaller error on unseen rows; of few stretches of motion, a small one."""
    if places.table.type.moving:
        return places.held_out_excess < min(effects.held_out_excess, MOST_UNSEEN)
    return _cross_validated(places) < _cross_validated(effects)


def _cross_validated(fit: Fit) -> float:
    """Rms error by cross-validation, in the output's unit: the floors of two fits may differ."""
    return fit.cross_validated_excess * float(np.sqrt(np.mean(fit.noise.floor**2)))


def _start_candidates(path: Path, final: FinalModel) -> tuple[Candidate, ...]:
    """Candidates on the given model, those of the final model first, the first one with its alternatives."""
    first = tuple(named_first(path.first, final.names))
    name = next((name for name in final.names), None)
    leading = next((c for c in first if c.name == name), None)
    if leading is None:
        return first
    if name in final.effect_candidates:
        leading = replace(leading, indistinguishable_from=final.effect_candidates[leading.name].indistinguishable_from)
    return leading, *(c for c in first if c.name != name)


def _order_steps(start: Fit, final: FinalModel, effects: Mapping[str, Effect]) -> tuple[Step[Fit], ...]:
    """One step an effect: first the effects that free a value which the model already has, then new ones."""
    freed = {term.name for term in start.model.terms}
    order = sorted(final.names, key=lambda name: name not in freed)
    steps: list[Step[Fit]] = []
    present = start
    for name in order:
        last = len(steps) == len(order) - 1
        extended = final.end if last else refit(present, present.model.with_effect(effects[name]))
        steps.append(Step(name, present, extended))
        present = extended
    return tuple(steps)


def _causes(steps: tuple[Step[Fit], ...], trials: int) -> tuple[str, ...]:
    """The effects of a search that are causes; a single effect always is one."""
    if len(steps) < 2:
        return tuple(step.name for step in steps)
    from calibrations.discovery.refinements import causes  # most searches end at one effect

    return causes(steps, trials)
