"""The parameters of a model as text: value, standard uncertainty, unit, change by the last effect, correlations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibrations.discovery.findings import FittedModel
from calibrations.fitting.budget import make_budget, parameter_correlation
from calibrations.fitting.fit import Fit
from calibrations.fitting.identifiability import correlation_matrix, covariance
from calibrations.fitting.inputs import input_contributions
from calibrations.model import Estimate, Model, Term
from calibrations.noise.fit import NoiseFit, power_covariance
from calibrations.table import Array
from calibrations.text import add_prefix, minus, rounded, unit, value_text

HEAD = ("effect", "parameter", "axis", "value", "standard uncertainty", "unit", "last change")
LEAST_CHANGE = 0.05  # standard uncertainties: a smaller change does not count
WHOLE = 10.0  # a value keeps its unit down to a tenth of it: 0.97 V/g, 97 mV/g
STRONG = 0.1  # correlations that are listed
NEW, SAME, NOT_IDENTIFIED = "new", "unchanged", "not identified"


@dataclass(frozen=True)
class ParameterRow:
    """One parameter. `change`: by the last added effect, "" before one. `why`: why it is not identified, else ""."""

    effect: str
    name: str
    axis: str
    value: str
    std: str
    unit: str
    change: str
    why: str
    doc: str

    @property
    def cells(self) -> tuple[str, ...]:
        """Texts in the order of `HEAD`; the reason in place of the value."""
        value = f"{NOT_IDENTIFIED}: {self.why}" if self.why else self.value
        return self.effect, self.name, self.axis, value, self.std, self.unit, self.change


@dataclass(frozen=True)
class CorrelatedPair:
    """Two parameters by their names, and their correlation coefficient."""

    first: str
    second: str
    coefficient: float


def parameter_rows(model: Model, earlier_model: Model | None = None) -> list[ParameterRow]:
    """A row for each parameter of `model`, with its change since the model `earlier_model`, if it is given."""
    earlier = {_key(term, e): e for term, e in _estimates(earlier_model)} if earlier_model is not None else {}
    rows = []
    for term, e in _estimates(model):
        change = "" if earlier_model is None else _change(e, earlier.get(_key(term, e)))
        doc = next((p.doc for p in term.effect.parameters if p.name == e.name), "")
        rows.append(_row(term.name, e, change, doc))
    for term in model.terms:
        rows += [
            ParameterRow(term.name, "curve", axis, f"{n} coefficients", "", "", "", "", "a free curve")
            for axis, n in term.coefficients.items()
        ]
    return rows


def tab_separated(rows: Sequence[ParameterRow]) -> str:
    """The table as text for a spreadsheet."""
    return "\n".join("\t".join(cells) for cells in (HEAD, *(row.cells for row in rows)))


def correlations(fit: FittedModel) -> list[CorrelatedPair]:
    """Pairs of identified parameters with |r| of `STRONG` or more, strongest first.

    For data with an uncertainty budget they include the shared inputs, as in the certificate; else the noise alone.
    """
    pairs = [pair for names, matrix in _matrices(fit) for pair in _pairs(names, matrix)]
    return sorted(pairs, key=lambda pair: -abs(pair.coefficient))


def _estimates(model: Model) -> Iterator[tuple[Term, Estimate]]:
    return ((term, e) for term in model.terms for e in term.quantities)


def _key(term: Term, e: Estimate) -> tuple[str, str, str]:
    return term.name, e.name, e.axis


def _row(effect: str, e: Estimate, change: str, doc: str) -> ParameterRow:
    name = e.name.replace("_", " ")
    if not e.identified:
        why = e.why or "the data do not determine it"
        return ParameterRow(effect, name, e.axis, NOT_IDENTIFIED, "", "", change, why, doc)
    factor, prefixed_unit = _scale(e)
    if not e.std:
        return ParameterRow(effect, name, e.axis, minus(f"{e.value * factor:.6g}"), "–", prefixed_unit, change, "", doc)
    value = value_text(e.value * factor, e.std * factor)
    return ParameterRow(effect, name, e.axis, value, rounded(e.std * factor, 2), prefixed_unit, change, "", doc)


def _scale(e: Estimate) -> tuple[float, str]:
    """Factor and unit in which value and uncertainty are written."""
    return add_prefix(unit(e.unit), max(abs(e.value), e.std or 0.0) * WHOLE)


def _change(e: Estimate, earlier: Estimate | None) -> str:
    if earlier is None:
        return NEW
    if earlier.identified != e.identified:
        return "now identified" if e.identified else "was identified"
    if not e.identified:
        return SAME
    difference, std = e.value - earlier.value, earlier.std or e.std or 0.0
    if abs(difference) <= LEAST_CHANGE * std:
        return SAME
    factor, prefixed_unit = add_prefix(unit(e.unit), abs(difference))
    ratio = f" ({rounded(abs(difference) / std, 2)} × its uncertainty)" if std else ""
    return f"{'+' if difference > 0 else ''}{minus(rounded(difference * factor, 2))} {prefixed_unit}".rstrip() + ratio


def _matrices(fit: FittedModel) -> Iterator[tuple[list[str], Array]]:
    """Names and correlation matrix of parameters that were fitted together."""
    if isinstance(fit, Fit):
        estimates = fit.model.all_estimates
        listed = [k for k, (term, e) in enumerate(estimates) if e.identified and e.std and e in term.quantities]
        if listed:
            names = [_name(estimates[k][0].name, estimates[k][1].name, estimates[k][1].axis) for k in listed]
            yield names, _correlation(fit)[np.ix_(listed, listed)]
    elif isinstance(fit, NoiseFit):
        for channel in fit.channels:
            if channel.effects:
                keys, matrix = power_covariance(channel)
                yield [_name(effect, name, channel.channel.axis) for effect, name in keys], correlation_matrix(matrix)


def _correlation(fit: Fit) -> Array:
    inputs: Any = input_contributions(fit.table) if fit.table.type.budget else ()
    if inputs and (budget := make_budget(fit, inputs)).given:
        return parameter_correlation(fit, budget, inputs)
    return correlation_matrix(covariance(fit.in_all_noise().information, fit.problem.layout.typical)[0])


def _name(effect: str, parameter: str, axis: str) -> str:
    parts = [effect, "" if parameter.replace("_", "-") == effect else parameter.replace("_", " "), axis]
    return " ".join(filter(None, parts))


def _pairs(names: Sequence[str], matrix: Array) -> Iterator[CorrelatedPair]:
    for k, first in enumerate(names):
        for j in range(k):
            if np.isfinite(matrix[k, j]) and abs(matrix[k, j]) >= STRONG:
                yield CorrelatedPair(names[j], first, float(matrix[k, j]))
