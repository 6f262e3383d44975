"""Tables of rows in the loop: poses, positions, fields, rates and motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from calibrations.criteria import FEWEST_FOR_FLOOR, WRONG_FLOOR
from calibrations.discovery.candidates import candidates, with_planned
from calibrations.discovery.dataset import Dataset
from calibrations.discovery.findings import Candidate, Findings, Place, Step
from calibrations.discovery.fit_doubts import fit_doubts
from calibrations.discovery.outliers import fit_without, outliers_in_fit
from calibrations.discovery.places import fails_by_scatter_only, places
from calibrations.discovery.plausibility import refusal, rejection
from calibrations.discovery.row_search import ONE_ORIENTATION, RowSearch
from calibrations.discovery.summary import SummaryRow, step_shares, summary_lines
from calibrations.discovery.verdict import Finding
from calibrations.effects import Effect
from calibrations.errors import ModelError, nearest
from calibrations.fitting.determined import blind_to, explain_undetermined
from calibrations.fitting.fit import Fit, axis_of, evaluate, fit, refit
from calibrations.free_forms.place_names import PREFIX
from calibrations.geometry.orientation import one_orientation
from calibrations.means.noise import rms
from calibrations.model import Model
from calibrations.table import NUMBERS, Array, Table

if TYPE_CHECKING:
    from calibrations.discovery.curves import PlaceCurve
    from calibrations.discovery.enough import Enough
    from calibrations.discovery.results import Discovery
    from calibrations.model.correlations import Correlations

INFLUENCES = ("temperature_c", "supply_v", "t_s")  # that a product may measure


@dataclass(frozen=True, eq=False)
class Rows(Dataset[Fit]):
    """A table whose rows are fitted by least squares."""

    table: Table

    form = "rows"
    floor = "the noise floor"
    complete = "The model fails nowhere: the residual is noise."

    @property
    def default_model(self) -> str:
        """The shipped model for this content."""
        return self.table.type.default_model

    @property
    def unseen(self) -> str:
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
        """The remark on a motion: the report also shows the models of its sweep."""
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

        place_names = tuple(dict.fromkeys(place_to_leave_out(place) for place in places))
        for place in place_names:
            column = place.removeprefix("column:")
            if column not in (place, "std", *self.table.columns):
                hint = nearest(column, self.table.columns)
                raise ModelError(f"{place} cannot be left out: {self.source} has no column {column}{hint}")
        return Rows(replace(self.table, left_out=place_names))

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

    def is_noise_known(self, fit: Fit) -> bool:
        """Whether it follows from the samples of each row."""
        return fit.noise.known

    def fails_by_scatter_only(self, fit: Fit) -> bool:
        """Whether a model fails nowhere if the scatter from row to row counts as noise."""
        return fails_by_scatter_only(fit)

    def places(self, fit: Fit) -> tuple[Place, ...]:
        """Stretches of columns."""
        return places(fit)

    def search(self, model: Model, effects: Mapping[str, Effect]) -> Findings[Fit]:
        """One effect if it explains all, else acting places and their causes; for other kinds, forward steps."""
        if (reason := refusal(self.table)) is not None:
            return self._search.rejected(self.fit(model), reason)
        start, outliers = fit_without(model, self.table)
        return self._search.findings(start, outliers, start, effects)

    def search_on(self, start: Fit, origin: Fit, effects: Mapping[str, Effect]) -> Findings[Fit]:
        """The search from a fitted model."""
        return self._search.findings(start, self._outliers_of(start), origin, effects)

    def addition(self, effect: Effect, model: Model, effects: Mapping[str, Effect]) -> Findings[Fit]:
        """One effect, with the effects that the data cannot separate from it."""
        return self._search.addition(effect, *fit_without(model, self.table), effects)

    @property
    def _search(self) -> RowSearch:
        return RowSearch(self, self.table)

    def until(self, findings: Findings[Fit], enough: Enough) -> Findings[Fit]:
        """The findings up to the first model whose error on unseen rows is small enough. Raises ModelError."""
        from calibrations.discovery.enough import until  # few searches stop before their end

        return until(findings, enough)

    def candidates(self, base: Fit, plan: Findings[Fit], effects: Mapping[str, Effect]) -> tuple[Candidate, ...]:
        """One round of the search, the effects of the plan first."""
        ranked = candidates(base, effects)
        return tuple(with_planned(ranked, plan.steps) if plan.steps else ranked)

    def fit_without_outliers(self, model: Model) -> tuple[Rows, Fit]:
        """(the table without gross outliers, the model fitted to it)."""
        start, outliers = fit_without(model, self.table)
        return (Rows(start.table) if outliers else self), start

    def _outliers_of(self, fit: Fit) -> tuple[int, ...]:
        """Numbers of the rows that a fit leaves out."""
        if not self.table.type.stage_angles:
            return ()
        all_rows = np.arange(self.table.n)
        numbers = fit.table.numbered(np.arange(fit.table.n))
        return tuple(map(int, np.setdiff1d(self.table.numbered(all_rows), numbers)))

    def undetermined(self, fit: Fit) -> str | None:
        """The reason why a small residual proves nothing on these data."""
        return explain_undetermined(fit)

    def untestable(self, fit: Fit, effects: Mapping[str, Effect]) -> str | None:
        """The effects that these data cannot show together with the model."""
        names = blind_to(fit, effects)
        if not names:
            return None
        if self.at_rest:
            return None  # the verdict and the cautions say it for all effects of the force
        angles = fit.table.column("alpha_deg") if fit.table.type.stage_angles else np.arange(2.0)
        hint = f" The data has only one inclination, alpha = {angles[0]:g} deg; measure at other inclinations."
        return (
            f"With the model {fit.model.name}, these effects cannot be tested on this data: {', '.join(names)}."
            f"{'' if np.ptp(angles) else hint}"
        )

    def expression(self, name: str, text: str) -> Effect:
        """An effect that the user wrote, on the columns of this table."""
        from calibrations.effects.expression_effect import effect_for  # few sessions write one

        return effect_for(name, text, self.table)

    @property
    def foreseeable(self) -> bool:
        """Whether the table has poses, whose angles are planned."""
        return self.table.type.stage_angles

    def rejection(self, fit: Fit) -> Finding | None:
        """The reason not to use these poses, or the values of a fit."""
        return rejection(fit)

    def covered(self, fit: Fit) -> dict[str, tuple[float, float]]:
        """Lowest and highest value of the influences of every sensor, and of the model's own."""
        table = fit.table
        model_columns = {name for term in fit.model.terms for name in term.effect.needs if name not in NUMBERS}
        names = [name for name in (*INFLUENCES, *sorted(model_columns)) if name in table and table.n]
        return {name: (float(table.column(name).min()), float(table.column(name).max())) for name in names}

    def correlations(self, fit: Fit) -> Correlations | None:
        """Correlations of the identified parameters, by the noise; without the coefficients of a large free form."""
        from calibrations.model.correlations import MOST, Correlations  # only what writes a model needs them

        identified = {key: e for key, e in fit.params.items() if e.identified and e.std}
        if len(identified) > MOST:
            quantities = [e for term in fit.model.terms for e in term.quantities]
            identified = {key: e for key, e in identified.items() if any(e is quantity for quantity in quantities)}
        if not 1 < len(identified) <= MOST:
            return None
        places = [k for k, key in enumerate(fit.params) if key in identified]
        return Correlations.of(list(identified), fit.correlation[np.ix_(places, places)])

    def step(self, effect: Effect, base: Fit) -> Step[Fit]:
        """The effect added, with both errors in one floor. Raises ModelError if it adds nothing."""
        extended = refit(base, base.model.with_effect(effect))
        if effect.expression:
            _require_new(extended, effect.name, base.model.name)
        floor = extended.noise.scatter
        return Step(effect.name, base.in_floor(floor), extended.in_floor(floor))

    def in_one_floor(self, start: Fit, steps: tuple[Step[Fit], ...]) -> tuple[Fit, tuple[Step[Fit], ...]]:
        """All errors in multiples of the last residual, if that is the only measure of noise."""
        floor = (steps[-1].after if steps else start).noise.scatter
        return start.in_floor(floor), tuple(
            replace(step, before=step.before.in_floor(floor), after=step.after.in_floor(floor)) for step in steps
        )

    def require_allowed(self, effect: Effect) -> None:
        """Raises ModelError where the table lacks a column, or the effect is defined for another kind."""
        if (reason := effect.excluded(self.table)) is not None:
            t = self.table
            if effect.name.startswith(PREFIX) and t.content in effect.kinds:
                raise ModelError(f"{effect.name} {reason} ({t.source})")
            raise ModelError(f"{effect.name} {reason}; {t.source} is a table of {t.kind}: {', '.join(t.columns)}")

    def errors_document(self, fit: Fit) -> dict[str, Any]:
        """rmse, noise floor, slow noise and excess by axis."""
        return {
            "rmse": _by_axis(fit, fit.rmse),
            "noise_floor": _by_axis(fit, fit.noise.floor),
            "slow_noise": _by_axis(fit, fit.noise.slow),
            "excess": _by_axis(fit, fit.excess),
        }

    def step_shares(self, discovery: Discovery[Fit]) -> list[float | None]:
        """On unseen data."""
        return step_shares(discovery)

    def summary(self, discovery: Discovery[Fit]) -> list[SummaryRow]:
        """Largest first."""
        return summary_lines(discovery)

    def place_curves(self, findings: Findings[Fit]) -> dict[str, PlaceCurve]:
        """Those of places with a single driver."""
        if not findings.places:
            return {}
        from calibrations.discovery.curves import place_curves  # few results have places

        return place_curves(findings)

    def remarks(self, fit: Fit) -> list[str]:
        """A remark on a residual below the noise floor: then the floor is wrong."""
        if not fit.noise.known or fit.pooled_excess > WRONG_FLOOR or fit.table.n < FEWEST_FOR_FLOOR:
            return []
        return ["The error is smaller than the noise floor: check the standard deviations and n of these means."]

    def cautions(self, fit: Fit) -> list[str]:
        """Reasons why a fit of all rows may mislead: an undetermined model, outliers."""
        one_orientation_text = ONE_ORIENTATION if self.at_rest else None
        return [
            *filter(None, (one_orientation_text, explain_undetermined(fit), outliers_in_fit(fit))),
            *self.doubts(fit),
        ]

    def doubts(self, fit: Fit) -> list[str]:
        """Doubts about the stated noise, and about parameters that no sensor has."""
        return list(fit_doubts(fit))


def _require_new(fit: Fit, name: str, model: str) -> None:
    """An expression has to add something that `model` does not have. Raises ModelError."""
    estimates = fit.model.estimates(name)
    if all(e.std is None for e in estimates):
        e = estimates[0]
        parameter = f"{e.name}.{e.axis}" if e.axis else e.name
        raise ModelError(
            f'{name} changes nothing that {model} cannot already describe: its parameter "{parameter}", {e.why}'
        )


def _by_axis(fit: Fit, values: Array) -> dict[str, float]:
    """By axis; of the parts of a motion their root mean square."""
    by_axis: dict[str, list[float]] = {}
    for channel, value in zip(fit.channels, np.asarray(values), strict=True):
        by_axis.setdefault(axis_of(channel), []).append(float(value))
    return {
        axis: channel_values[0] if len(channel_values) == 1 else float(rms(np.array(channel_values)))
        for axis, channel_values in by_axis.items()
    }
