"""What knowing the causes alone would give: the catalogue's own forms of them, fitted to the same data.

What this misses on fresh poses is the catalogue's form, or what the noise allows; naming has no part in it.
"""

from __future__ import annotations

from typing import Any

from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit, refit
from calibrations.model.file import read_model
from calibrations.table import Table
from tests.benchmark.discovery.cases import Truth
from tests.benchmark.discovery.ours import error


def answer(table: Table, truth: Truth) -> dict[str, Any] | None:
    """The error of the model with all causes; None where the catalogue has no names for them."""
    if not truth.causes or truth.outside:
        return None
    found = fit(read_model("linear"), table)
    for names in truth.causes:
        found = refit(found, found.model.with_effect(catalogue()[min(names)]))
    return {"error": error(found.model, table, truth)}
