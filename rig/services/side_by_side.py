"""Two runs, or two sensors of a run, beside each other: what each gave, and whether they differ beyond doubt.

`deviations` is the difference over its standard uncertainty, the two taken as independent: beyond 2 it is hardly chance
(E_n of ISO/IEC 17043 is half of it).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import hypot
from typing import Any

from calibrations.discovery.results import FittedModel
from calibrations.model import Estimate
from rig.record import Run

DIFFERENT = 2.0  # standard uncertainties


@dataclass(frozen=True)
class Pair:
    """One quantity of both, in `unit`."""

    name: str
    unit: str
    first: float
    second: float
    first_std: float | None
    second_std: float | None

    @property
    def difference(self) -> float:
        """The second less the first."""
        return self.second - self.first

    @property
    def std(self) -> float | None:
        """Of the difference; None where neither uncertainty is known."""
        return hypot(self.first_std or 0.0, self.second_std or 0.0) or None

    @property
    def deviations(self) -> float | None:
        """The difference in standard uncertainties."""
        return None if self.std is None else self.difference / self.std

    @property
    def differ(self) -> bool:
        """Whether the difference is hardly chance."""
        return self.deviations is not None and abs(self.deviations) > DIFFERENT


def results_of(first: Run, second: Run, sensors: tuple[str, str] = ("", "")) -> list[Pair]:
    """The results that both have; of a batch those of the sensors named."""
    one, other = (_own(run.results, sensor) for run, sensor in zip((first, second), sensors, strict=True))
    return [
        Pair(name, a["unit"], a["value"], b["value"], a["std"], b["std"])
        for name, a in one.items()
        if (b := other.get(name)) is not None and a["unit"] == b["unit"]
    ]


def parameters_of(first: FittedModel, second: FittedModel) -> list[Pair]:
    """The parameters of one model that was fitted to both."""
    other = dict(_estimates(second))
    return [
        Pair(name, a.unit, a.value, b.value, a.std, b.std)
        for name, a in _estimates(first)
        if (b := other.get(name)) is not None and a.identified and b.identified
    ]


def _own(results: Mapping[str, Any], sensor: str) -> Mapping[str, Any]:
    """Those of one sensor, without its name; those of all as they are."""
    if not sensor:
        return results
    return {name.rpartition("/")[2]: each for name, each in results.items() if name.startswith(f"{sensor}/")}


def _estimates(fit: FittedModel) -> Iterator[tuple[str, Estimate]]:
    for term in fit.model.terms:
        for each in term.estimates:
            yield " ".join(dict.fromkeys(filter(None, (term.name, each.name, each.axis)))), each
