"""The search in a table of rows: one effect if it explains all, else the places that act and their causes.

An effect whose loss would cost little beside the loss of the greatest is a refinement: it corrects the form in which
another acts, known only approximately, and is not named as a cause. Geometry is exact: a strong misalignment makes
nothing else a refinement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from calibrations.criteria import (
    FEWEST_FOR_PLACES,
    LEAST_NOISE,
    MATERIAL,
    MOST_EFFECTS,
    MOST_UNEXPLAINED,
    NO_MORE_THAN_NOISE,
)
from calibrations.discovery.candidates import candidates, with_rivals
from calibrations.discovery.findings import Candidate, Findings, Step
from calibrations.discovery.outliers import caution, told
from calibrations.discovery.plausibility import Finding, rejection
from calibrations.discovery.search import Path, Settled, continued, find_path, is_complete, recounted, settled
from calibrations.discovery.structure import plainer, poorly_predicted, structure_of
from calibrations.discovery.verdict import Verdict
from calibrations.effects import Effect
from calibrations.fitting.determined import undetermined
from calibrations.fitting.fit import Fit, refit
from calibrations.free_forms.place_names import place_of_effect, shown_at_rest
from calibrations.geometry.orientation import one_orientation
from calibrations.means.noise import correlation_known
from calibrations.table import Table
from calibrations.text import sentence

if TYPE_CHECKING:
    from calibrations.design.experiment import Experiment
    from calibrations.discovery.dataset import Dataset
    from calibrations.discovery.patterns import Pattern
    from calibrations.discovery.structural import StructuralSearch

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
        """All that the model of `start` misses; `outliers` are rows that its fit leaves out."""
        effects = self._searchable(effects)
        found = self._among(start, outliers, origin, effects)
        left_out = self.table.left_out
        remarks = [f"Places left out of the search: {', '.join(left_out)}."] if left_out else []
        remarks += [sentence(ONE_ORIENTATION)] if one_orientation(self.table) else []
        return replace(found, remarks=(*found.remarks, *remarks))

    def rejected(self, start: Fit, reason: Finding) -> Findings[Fit]:
        """Data in which no effect can be searched for."""
        return Findings(
            data=self.data, start=start, origin=start, baseline=start, left=reason.text, spoilt=True,
            unresponsive=reason.verdict == Verdict.NO_RESPONSE,
        )  # fmt: skip

    def addition(
        self, effect: Effect, start: Fit, outliers: tuple[int, ...], effects: Mapping[str, Effect]
    ) -> Findings[Fit]:
        """One chosen effect, with what the data cannot separate from it."""
        before = start.in_floor(start.noise.floor)
        step = self.data.step(effect, before)
        if (reason := rejection(step.after)) is not None:
            return replace(self.rejected(step.before, reason), steps=(step,))
        ranked = candidates(before, effects)
        own = next((with_rivals(c, ranked, before) for c in ranked if c.name == effect.name), None)
        rivals = own.indistinguishable_from if own is not None else ()
        return self._findings(
            step.before, step.after, outliers, _material_structure(step.after),
            steps=(step,),
            candidates=tuple(ranked),
            causes=(effect.name,),
            alternatives={effect.name: rivals} if rivals else {},
            searched=False,
        )  # fmt: skip

    def _searchable(self, effects: Mapping[str, Effect]) -> Mapping[str, Effect]:
        """The effects that act at none of the places that are left out; at one orientation those that it can show."""
        if one_orientation(self.table):
            effects = {name: effect for name, effect in effects.items() if shown_at_rest(name)}
        return {name: effect for name, effect in effects.items() if place_of_effect(name) not in self.table.left_out}

    def _among(
        self, start: Fit, outliers: tuple[int, ...], origin: Fit, effects: Mapping[str, Effect]
    ) -> Findings[Fit]:
        moving = self.table.type.moving
        path = find_path(start, outliers, effects, most=1 if self._shows_places or moving else MOST_EFFECTS)
        if moving and plainer(path.start, path.end) is None:
            path = continued(path, effects)
        if not self._shows_places or _explained(path):
            return self._on_path(path, effects, origin)
        from calibrations.discovery.structural import search_structure  # only this search needs it

        searched = search_structure(start, effects)
        if searched.steps and path.steps and _unseen_error(path.end) <= _unseen_error(searched.end):
            return self._on_path(path, effects, origin)  # what needs more must foretell more
        found = self._with_structure(searched, outliers, searched.start if origin is start else origin)
        if not (found.steps or path.steps) and structure_of(path.end) is None:
            return self._on_path(path, effects, origin)  # slow noise looks like a pattern in white noise
        return found

    @property
    def _shows_places(self) -> bool:
        """Whether the rows can show where in the signal chain something acts: enough poses at known angles.

        Slow noise that is known from a still record is not yet among what that search can take for given.
        """
        return self.table.type.stage_angles and self.table.n >= FEWEST_FOR_PLACES and not self.table.noise

    def _on_path(self, path: Path, effects: Mapping[str, Effect], origin: Fit) -> Findings[Fit]:
        stand = settled(path, effects)
        path, stand = recounted(path, stand.end), replace(stand, end=stand.end.in_floor(stand.end.noise.scatter))
        if (reason := rejection(stand.end)) is not None:
            return self.rejected(path.start, reason)
        better = plainer(path.start, stand.end)
        steps = _in_order(path.start, stand, effects)
        causes = _causes(steps, len(path.first))
        inseparable = {name: stand.beside[name].indistinguishable_from for name in causes if name in stand.beside}
        rivals = {name: others for name, others in inseparable.items() if others}
        left = (better or structure_of(stand.end)) if stand.end.pooled_excess > MATERIAL else None
        left = left or poorly_predicted(stand.end)
        found = self._findings(
            path.start, stand.end, path.outliers, left,
            origin=origin,
            steps=steps,
            candidates=_next_first(path, stand),
            causes=causes,
            alternatives=rivals,
            spoilt=left is not None and better is not None,
            separations=self._separations(rivals),
            settled=stand.tested,
        )  # fmt: skip
        if steps and found.given.verdict is Verdict.UNEXPLAINED:
            return found.without_steps()
        return _with_outliers(found)

    def _with_structure(self, searched: StructuralSearch, outliers: tuple[int, ...], origin: Fit) -> Findings[Fit]:
        start, end = searched.start, searched.end
        if (reason := rejection(end)) is not None:
            return self.rejected(start, reason)
        better = plainer(start, end, searched.causes_alone if searched.causes else None)
        left = better or _material_structure(end)
        if left is None and any(place.unknown for place in searched.structure.places):
            left = structure_of(searched.causes_alone)
        known = {c.name for c in searched.candidates}
        found = self._findings(
            start, end, outliers, left,
            origin=origin,
            steps=searched.steps,
            candidates=searched.candidates,
            causes=searched.causes,
            alternatives=searched.alternatives,
            places=searched.structure.places,
            spoilt=better is not None,
            separations=self._separations(
                {
                    name: tuple(other for other in others if other in known)
                    for name, others in searched.alternatives.items()
                    if known & set(others)
                }
            ),
            remarks=searched.remarks,
        )  # fmt: skip
        spoilt = better is not None or (found.final.share_left > MOST_UNEXPLAINED and not found.final.unknown)
        if searched.steps and spoilt:
            return found.without_steps()
        return _with_outliers(found)

    def _separations(self, rivals: Mapping[str, tuple[str, ...]]) -> dict[str, Experiment]:
        """By effect, the experiment that separates it from the others."""
        if not rivals:
            return {}
        from calibrations.design.experiment import separating_experiment  # few effects have rivals

        return {name: separating_experiment(name, others, self.table) for name, others in rivals.items()}

    def _findings(
        self, start: Fit, end: Fit, outliers: tuple[int, ...], left: Pattern | None, **rest: Any
    ) -> Findings[Fit]:
        """What every search states; `rest` holds the members of `Findings` that differ."""
        members: dict[str, Any] = {
            "origin": start,
            "left": left.text if left else None,
            "pattern": left,
            "undetermined": (undetermined(start), undetermined(end)),
            "set_aside": caution(outliers),
            "outliers": outliers,
        }
        return Findings(data=self.data, start=start, baseline=start, **members | rest)


def _with_outliers(found: Findings[Fit]) -> Findings[Fit]:
    """Rows that stand out are the unexplained part where nothing else is."""
    if found.outliers and not found.steps and found.left is None:
        return replace(found, left=told(found.outliers), spoilt=True)
    return found


def _material_structure(end: Fit) -> Pattern | None:
    """The pattern of a residual that is more than noise."""
    return structure_of(end) if end.pooled_excess > MATERIAL else None


def _explained(path: Path) -> bool:
    """Whether the effects of a path leave no more and no less than the noise of the samples, and no pattern.

    Where the samples of a mean may be correlated, more than their noise may be left. Not at one orientation: a lag of
    the temperature looks like a hysteresis in slow noise.
    """
    end = path.end
    most = NO_MORE_THAN_NOISE if correlation_known(end.table) or one_orientation(end.table) else np.inf
    as_noise = end.noise.known and LEAST_NOISE < end.pooled_excess < most
    return as_noise and structure_of(end) is None and is_complete(path)


def _unseen_error(fit: Fit) -> float:
    """Rms error on unseen rows, in the output's unit: the floors of two fits may differ."""
    return fit.held_out_excess * float(np.sqrt(np.mean(fit.noise.floor**2)))


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
