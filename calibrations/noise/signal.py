"""The response of a sensor at rest to temperature: terms of a model that are removed before the noise is fitted.

The means of a record in blocks are poses at one orientation, and are searched as such: bias over temperature as a line,
as a curve, with the lag of the sensor and with branches. What acts over time stays in the record: it is noise, or a
pattern that no noise makes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibrations.discovery.findings import Findings
from calibrations.effects import Effect, Values
from calibrations.errors import DataError
from calibrations.fitting.fit import Fit
from calibrations.fitting.fit import fit as fit_rows
from calibrations.free_forms.place_names import place_of_effect
from calibrations.means.noise import neighbour_std, with_white
from calibrations.model import Estimate, Model, Term
from calibrations.noise.deviations import DeviationCurve, octaves
from calibrations.noise.record import Channel, Still
from calibrations.table import AXES, Array, Table

TEMPERATURE, PLACE = "temperature_c", "temperature-bias"
MOST_ROWS = 400  # of the table of means: enough for any curve, and quick to search
LEAST_STD = 1e-6  # of the range of the means: their noise, if none is measured


def acts_on_record(effect: Effect) -> bool:
    """Whether an effect that is not noise can be taken off a still record: a bias over temperature."""
    return place_of_effect(effect.name) == PLACE


def signal_terms(model: Model) -> tuple[Term, ...]:
    """The terms of a model that are not noise."""
    return tuple(term for term in model.terms if not term.effect.is_noise)


def without_signal(still: Still, terms: tuple[Term, ...]) -> Still:
    """The record without the contributions of these terms; terms removed earlier are restored. Raises DataError."""
    if terms == still.signal:
        return still
    channels = tuple(
        replace(c, means=c.means + _contribution(still.signal, c, still.source) - _contribution(terms, c, still.source))
        for c in still.channels
    )
    return replace(with_cleaned_curves(replace(still, channels=channels), set(still.axes)), signal=terms)


def _contribution(terms: tuple[Term, ...], channel: Channel, source: str) -> Array:
    """Contribution of terms to the means of a channel, less its mean, shape (m,). Raises DataError."""
    if not terms:
        return np.zeros(len(channel.means))
    names = AXES[: AXES.index(channel.axis) + 1]
    table = _table(channel, {name: np.zeros(len(channel.means)) for name in names}, source)
    no_force = np.zeros((table.n, 3))
    parts = (term.effect.transduction(no_force, table, _values(term)) for term in terms)
    contribution = sum(parts, no_force)[:, AXES.index(channel.axis)]
    return np.asarray(contribution - contribution.mean())


def _values(term: Term) -> Values:
    """The values of a term by name; 0 for an axis without one."""
    values = {p.name: np.zeros(3 if p.per_axis else ()) for p in term.effect.parameters}
    for e in term.estimates:
        values[e.name] = np.where(np.array(AXES) == e.axis, e.value, values[e.name]) if e.axis else np.asarray(e.value)
    return Values.of({**term.constants, **values})


def _table(channel: Channel, outputs: Mapping[str, Array], source: str) -> Table:
    """Means of outputs by axis with their times and temperature, as poses of any one orientation. Raises DataError."""
    if TEMPERATURE not in channel.logged:
        raise DataError(
            f"{source}: the model has an effect of temperature, and the record has no {TEMPERATURE} that changes; use "
            "a model without it, or a record with the temperature"
        )
    warm, n = channel.logged[TEMPERATURE], len(channel.means)
    columns = {
        "alpha_deg": np.zeros(n),
        "beta_deg": np.zeros(n),
        "t_s": (np.arange(n) + 0.5) * channel.sampling.interval_s,
        TEMPERATURE: warm.level + warm.mean,
        **{f"v{axis}_v": values for axis, values in outputs.items()},
    }
    return Table.from_columns("poses", columns, None, source)


def table_of_means(still: Still) -> Table:
    """The record as at most `MOST_ROWS` poses at one orientation, with the noise that neighbouring means show."""
    first = still.channels[0]
    size = -(-len(first.means) // MOST_ROWS)
    means = _table(first, dict(zip(AXES, (c.means for c in still.channels), strict=False)), still.source)
    n = means.n // size
    columns = {name: x[: n * size].reshape(n, size).mean(axis=1) for name, x in means.columns.items()}
    table = replace(means, columns=columns)
    white = np.maximum(neighbour_std(table.outputs.T), LEAST_STD * np.ptp(table.outputs, axis=0))
    return with_white(table, np.tile(white[:, None], (1, n)))


@dataclass(frozen=True)
class SignalSearch:
    """The signal terms that a record shows, after each step that adds one, and the findings that they come from."""

    steps: tuple[tuple[Term, ...], ...]
    findings: Findings[Fit]
    table: Table
    given: tuple[str, ...] = ()

    @property
    def lags(self) -> tuple[str, ...]:
        """The lags of the sensor behind the thermometer, in words."""
        leads = {term.constants.get("lead_s", 0.0) for term in (self.steps[-1] if self.steps else ())}
        long = sorted(lead for lead in leads if abs(lead) > self._shortest_s)
        return tuple(
            f"The bias is {'ahead of' if lead > 0 else 'behind'} the thermometer, with a lag of {abs(lead):.3g} s."
            for lead in long
        )

    @property
    def _shortest_s(self) -> float:
        """A lag that the means can show."""
        return float(np.median(np.diff(self.table.time_s)))

    def with_line(self, name: str, effects: Mapping[str, Effect], still: Still) -> SignalSearch:
        """The search with a straight line in place of one effect; the others are fitted again from their own starts."""
        line = Term(effects[PLACE])
        last = tuple(line if term.name == name else replace(term, estimates=()) for term in self.steps[-1])
        fit = fit_rows(_bias_model(last, effects), self.table)
        terms = _terms(fit, {term.name for term in last}, still)
        steps = []
        for step_terms in self.steps:
            names = {PLACE if term.name == name else term.name for term in step_terms}
            changed_terms = tuple(term for term in terms if term.name in names)
            steps.append(changed_terms if PLACE in names or step_terms is self.steps[-1] else step_terms)
        return replace(self, steps=tuple(steps))

    def without(self, name: str, effects: Mapping[str, Effect], still: Still) -> SignalSearch:
        """The search without one effect; the others are fitted again."""
        position = self.names.index(name)
        remaining = [tuple(term for term in terms if term.name != name) for terms in self.steps]
        fit = fit_rows(_bias_model(_rename_axes(remaining[-1], still.axes, AXES), effects), self.table)
        remaining[-1] = _terms(fit, {term.name for term in remaining[-1]}, still)
        return replace(
            self,
            steps=tuple(
                terms
                for k, terms in enumerate(remaining)
                if k != (position if position < len(remaining) - 1 else position - 1)
            ),
        )

    @property
    def names(self) -> tuple[str, ...]:
        """The effects in the order in which they are added to those that are given."""
        names_in_order = list(self.given)
        for terms in self.steps:
            names_in_order += [term.name for term in terms if term.name not in names_in_order]
        return tuple(names_in_order[len(self.given) :])

    @property
    def causes(self) -> tuple[str, ...]:
        """The terms that are causes; a curve alone is a cause of its own."""
        return tuple(name for name in self.names if name in self.findings.causes) or self.names[:1]


def search_signal(
    still: Still, effects: Mapping[str, Effect], lag_s: float, model_terms: tuple[Term, ...] = ()
) -> SignalSearch:
    """Effects of temperature on outputs beyond the terms of the model, by the search at one orientation.

    Beside slow noise that search may see nothing: then a straight line, with the lag that was found beside that noise.
    """
    from calibrations.discovery.rows import Rows  # noise alone needs no search in rows

    table = table_of_means(without_signal(still, ()))
    search = Rows(table).search(_bias_model(_rename_axes(model_terms, still.axes, AXES), effects), effects)
    names_so_far = {term.name for term in model_terms}
    steps: list[tuple[Term, ...]] = []
    for step in search.steps:
        if place_of_effect(step.name) == PLACE:
            names_so_far |= {step.name}
            steps.append(_terms(step.after, names_so_far, still))
    if steps:
        steps[-1] = _terms(search.end, names_so_far, still)
    elif not model_terms:
        line = Term(effects[PLACE], constants={"lead_s": -lag_s})
        steps.append(_terms(fit_rows(_bias_model((line,), effects), table), {PLACE}, still))
    return SignalSearch(tuple(steps), search, table, tuple(term.name for term in model_terms))


def fit_signal(model: Model, still: Still, effects: Mapping[str, Effect]) -> Model:
    """The model with its signal terms estimated from the record; the noise is unchanged."""
    terms = signal_terms(model)
    if not terms:
        return model
    fit = fit_rows(
        _bias_model(_rename_axes(terms, still.axes, AXES), effects), table_of_means(without_signal(still, ()))
    )
    fitted = {term.name: term for term in _terms(fit, {term.name for term in terms}, still)}
    return replace(model, terms=tuple(fitted.get(term.name, term) for term in model.terms))


def _bias_model(terms: tuple[Term, ...], effects: Mapping[str, Effect]) -> Model:
    return Model("at rest", (Term(effects["bias"]), *terms))


def _terms(fit: Fit, names: set[str], still: Still) -> tuple[Term, ...]:
    """Terms of a fit to the table of means, for the axes and the unit of the record.

    The scatter of the thermometer is taken off as far as it is known: its doubt adds to that of a slope.
    """
    selected = tuple(term for term in fit.model.terms if term.name in names)
    doubts = {channel.axis: channel.logged[TEMPERATURE].doubt for channel in still.channels}

    def with_record_unit(e: Estimate) -> Estimate:
        unit = e.unit.replace(fit.table.unit, still.unit)
        doubt = doubts.get(e.axis, 0.0) * e.value if e.name == "slope" else 0.0
        return replace(e, unit=unit, std=None if e.std is None else float(np.hypot(e.std, doubt)))

    return tuple(
        replace(term, estimates=tuple(map(with_record_unit, term.estimates)))
        for term in _rename_axes(selected, AXES, still.axes)
    )


def _rename_axes(terms: tuple[Term, ...], old_axes: Sequence[str], new_axes: Sequence[str]) -> tuple[Term, ...]:
    """Terms with other names of their axes."""
    names = dict(zip(old_axes, new_axes, strict=False))

    def rename(e: Estimate) -> Estimate:
        return replace(e, axis=names.get(e.axis, e.axis))

    return tuple(replace(term, estimates=tuple(map(rename, term.estimates))) for term in terms)


def with_cleaned_curves(still: Still, axes: set[str]) -> Still:
    """The record with Allan deviations of these axes' means as they are now, from a mean's length on."""
    curves = {c.axis: _clean_curve(still.allan[c.axis], c) for c in still.channels if c.axis in axes}
    return replace(still, allan={**still.allan, **curves})


def _clean_curve(curve: DeviationCurve, channel: Channel) -> DeviationCurve:
    """The curve of a channel whose means have changed."""
    slow = octaves([channel.means], 1 / channel.sampling.interval_s)
    fast = np.arange(len(curve.tau_s)) < len(curve.tau_s) - len(slow.tau_s)
    parts = ((getattr(curve, name)[fast], getattr(slow, name)) for name in ("tau_s", "deviation", "low", "high", "edf"))
    tau_s, deviation, low, high, edf = map(np.concatenate, parts)
    return DeviationCurve(
        curve.kind, tau_s, deviation, low, high, (*np.array(curve.alpha)[fast].tolist(), *slow.alpha), edf
    )
