"""The uncertainty budget as rows of a table and as JSON: each source of a parameter, its size, and its type."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibrations.fitting.budget import Budget, make_budget
from calibrations.fitting.fit import Fit
from calibrations.fitting.inputs import input_contributions
from calibrations.model import Estimate
from calibrations.presentation.document import Remark, Section, Table
from calibrations.text import INFINITE_FREEDOM, contribution_text, freedom_text, in_prefix, rounded, unit

SOURCE_HEAD = ("source", "type", "standard uncertainty of the source", "sensitivity", "contribution", "ν")
METHOD = (
    "After the GUM (JCGM 100). Type A: the noise of the fit. Type B: uncertainties of inputs that the bench or the "
    "file states. Expanded uncertainties have 95 % coverage, with the effective degrees of freedom (Welch and "
    "Satterthwaite)."
)


@dataclass(frozen=True)
class Source:
    """One line of a budget: `contribution` in the result's unit, `sensitivity` and `std` None for type A."""

    name: str
    kind: str
    unit: str
    std: float | None
    sensitivity: float | None
    contribution: float
    freedom: float

    def cells(self, combined: float, factor: float = 1.0) -> tuple[str, ...]:
        """Texts in the order of `SOURCE_HEAD`, for a `combined` standard uncertainty. `factor`: from the result's
        unit to the one that is shown."""
        return (
            self.name,
            self.kind,
            "–" if self.std is None else f"{rounded(self.std, 2)} {unit(self.unit)}".strip(),
            "–" if self.sensitivity is None else rounded(factor * self.sensitivity, 2),
            contribution_text(factor * self.contribution, factor * combined),
            freedom_text(self.freedom),
        )


def sources(budget: Budget, k: int) -> tuple[Source, ...]:
    """The sources of parameter `k` that have a number."""
    return tuple(
        Source(
            line.source,
            line.kind,
            line.unit,
            line.input_std,
            None if line.sensitivity is None else float(line.sensitivity[k]),
            0.0 if line.std is None or np.isnan(line.std[k]) else float(line.std[k]),
            line.freedom,
        )
        for line in budget.given
    )


def budget_section(fit: Fit) -> Section | None:
    """The section of a report; None for tables that have no budget, and where nothing is known."""
    budget = _budget(fit)
    if budget is None or not budget.given:
        return None
    head = (
        "effect", "parameter", "combined standard uncertainty", "degrees of freedom", "coverage factor",
        "expanded uncertainty", "unit", "largest source",
    )  # fmt: skip
    rows, lines = [], dict[str, list[tuple[str, ...]]]()
    for k, effect, e in _identified_estimates(fit):
        label, combined, expanded = f"{e.name} {e.axis}".strip(), float(budget.combined[k]), float(budget.expanded[k])
        factor, prefixed_unit = in_prefix(expanded, None, e.unit)
        largest = max(sources(budget, k), key=lambda source: source.contribution)
        rows.append((
            effect, label, rounded(factor * combined, 2), freedom_text(budget.freedom[k]), f"{budget.coverage[k]:.2f}",
            rounded(factor * expanded, 2), unit(prefixed_unit), largest.name,
        ))  # fmt: skip
        for number, source in enumerate(sources(budget, k)):
            name = "" if number else f"{label}, {unit(prefixed_unit)}"
            lines.setdefault(effect, []).append((name, *source.cells(combined, factor)))
    missing = [Remark(f"Not given and not included: {', '.join(budget.not_given)}.")] if budget.not_given else []
    parts = (
        Table(f"Sources of {effect}", ("parameter", *SOURCE_HEAD), cells, (3, 4, 5, 6), folded=True, grouped=True)
        for effect, cells in lines.items()
    )
    combined_table = Table("Combined and expanded uncertainties", head, rows, (2, 3, 4, 5), headed=False)
    return Section("Uncertainty budget", (METHOD, combined_table, *missing, *parts))


def budget_document(fit: Fit) -> Mapping[str, Any] | None:
    """JSON of the combined uncertainty of each parameter, with its contributions by source; None without any."""
    budget = _budget(fit)
    if budget is None:
        return None
    return {
        "parameters": [
            {
                "effect": effect,
                "axis": e.axis or None,
                "name": e.name,
                "combined": float(budget.combined[k]),
                "freedom": float(budget.freedom[k]) if budget.freedom[k] < INFINITE_FREEDOM else None,
                "coverage_factor": float(budget.coverage[k]),
                "expanded": float(budget.expanded[k]),
                "contributions": {source.name: source.contribution for source in sources(budget, k)},
            }
            for k, effect, e in _identified_estimates(fit)
        ],
        "not_given": list(budget.not_given),
    }


def _budget(fit: Fit) -> Budget | None:
    if not fit.table.type.budget or not len(fit.theta):
        return None
    return make_budget(fit, input_contributions(fit.table))


def _identified_estimates(fit: Fit) -> Iterator[tuple[int, str, Estimate]]:
    """Number, effect and estimate of each identified quantity; coefficients of free forms have no budget."""
    for k, (term, e) in enumerate(fit.model.all_estimates):
        if e in term.quantities and e.identified and e.std is not None:
            yield k, term.name, e
