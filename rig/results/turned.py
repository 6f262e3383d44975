"""What the results of turned sensors have in common: a fitted model's parameters as results."""

from __future__ import annotations

from collections.abc import Iterator

from calibrations.effect import catalogue
from calibrations.fit import Fit, fit
from calibrations.model import Estimate
from calibrations.model_file import read_model
from calibrations.table import Table
from rig.results.result import Missing, Result


def fitted(table: Table, model: str, *more: str) -> Fit:
    """A shipped model, with the effects `more` that the table can have. Raises what `fit` raises."""
    effects, start = catalogue(), read_model(model)
    for name in more:
        if effects[name].excluded(table) is None:
            start = start.with_effect(effects[name])
    return fit(start, table)


def estimates(found: Fit, effect: str) -> Iterator[Estimate]:
    """The parameters of one effect of a fitted model."""
    for term in found.model.terms:
        if term.name == effect:
            yield from term.estimates


def result(estimate: Estimate, unit: str | None = None, per: float = 1.0) -> Result | Missing:
    """An estimate as a result, over `per`; Missing where the data do not determine it."""
    if not estimate.identified:
        return Missing(estimate.why or "it is not identified")
    std = None if estimate.std is None else abs(estimate.std / per)
    return Result(estimate.value / per, estimate.unit if unit is None else unit, std)
