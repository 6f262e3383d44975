"""A result: one measured quantity, and its verdict by a limit and the uncertainty; the register of the evaluations.

pass      within the limit by more than the expanded uncertainty (k = 2)
fail      beyond it by more than that
marginal  neither
Source    ISO 14253-1, JCGM 106: a guard band on both sides of the limit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from calibrations.criteria import COVERAGE_FACTOR
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import Fit, fit
from calibrations.means.noise import rms
from calibrations.model import Estimate
from calibrations.model.file import read_model
from calibrations.table import Table
from procedures.errors import ProcedureError
from rig.record.measured import MeasuredRun

Limit = float | tuple[float, float]


@dataclass(frozen=True)
class Result:
    """A value with its standard uncertainty, in `unit`; `std` is None if it is not known."""

    value: float
    unit: str
    std: float | None = None

    def verdict(self, limit: Limit) -> str:
        """pass, fail or marginal; a single number limits the magnitude."""
        low, high = (-limit, limit) if isinstance(limit, (int, float)) else limit
        margin = min(self.value - low, high - self.value)
        guard = COVERAGE_FACTOR * (self.std or 0.0)
        return "pass" if margin >= guard else "fail" if margin < -guard else "marginal"


@dataclass(frozen=True)
class Missing:
    """A result that the poses do not determine, and the reason."""

    why: str


# The evaluation of a procedure: a function of what a run measured, which its module registers.


@dataclass(frozen=True)
class Evaluation:
    """The results of a procedure by name. `rig.bench.result_names` lists the names.

    `of_bench`: the results are those of the bench, and the same for all sensors of a batch.
    """

    evaluate: Callable[[MeasuredRun], Mapping[str, Result | Missing]]
    of_bench: bool = False


EVALUATIONS: dict[str, Evaluation] = {}
Evaluate = TypeVar("Evaluate", bound=Callable[[MeasuredRun], Mapping[str, Any]])


def evaluates(procedure: str, *, of_bench: bool = False) -> Callable[[Evaluate], Evaluate]:
    """Register a function as the evaluation of `procedure`, see Evaluation."""

    def register(evaluate: Evaluate) -> Evaluate:
        EVALUATIONS[procedure] = Evaluation(evaluate, of_bench)
        return evaluate

    return register


# Results that a procedure returns itself, and results as documents.


def read_returned(name: str, document: Any) -> Result:
    """A result that a procedure returns itself: {"value": 2.0, "unit": "g", "std": 0.1}. Raises ProcedureError."""
    try:
        std = document.get("std")
        return Result(float(document["value"]), str(document["unit"]), None if std is None else float(std))
    except (AttributeError, KeyError, TypeError, ValueError):
        form = 'a result is a mapping such as {"value": 2.0, "unit": "g", "std": 0.1}'
        raise ProcedureError(f"the procedure returned {name} = {document!r}; {form}") from None


def documents(results: Mapping[str, Result], limits: Mapping[str, Limit]) -> dict[str, dict[str, Any]]:
    """The results as JSON, each with its limit and verdict if the bench has a limit."""
    return {
        name: {
            "value": result.value,
            "std": result.std,
            "unit": result.unit,
            "limit": (limit := limits.get(name.rpartition("/")[2])),
            "verdict": result.verdict(limit) if limit is not None else None,
        }
        for name, result in results.items()
    }


# Parameters of a fitted model as results.

SHORT_NAMES = {  # of effects in results
    "scale-factor": "scale",
    "gyro-scale-factor": "gyro-scale",
    "axis-nonorthogonality": "nonorthogonality",
}


def fit_shipped(table: Table, model: str, *effect_names: str) -> Fit:
    """The fit of a shipped model with those of the effects `effect_names` that suit the table. Raises as `fit`."""
    effects, start = catalogue(), read_model(model)
    for name in effect_names:
        if effects[name].excluded(table) is None:
            start = start.with_effect(effects[name])
    return fit(start, table)


def estimates(fit: Fit, *effects: str) -> dict[str, Result | Missing]:
    """The parameters of effects by the effect and the axis, or the pair of axes: `hard-iron-x`, `soft-iron-xy`."""
    return {
        f"{SHORT_NAMES.get(effect, effect)}-{estimate.axis or estimate.name}": result(estimate)
        for effect in effects
        for estimate in fit.model.estimates(effect)
    }


def gyroscope(fit: Fit) -> dict[str, Result | Missing]:
    """Bias, scale factor and misalignment of a gyroscope."""
    return estimates(fit, "gyro-bias", "gyro-scale-factor", "gyro-misalignment")


def ellipsoid(fit: Fit) -> dict[str, Result | Missing]:
    """Hard and soft iron, and the rms residual of the magnitude."""
    residual = Result(float(1e3 * rms(fit.residual)[0]), "per mille")
    return estimates(fit, "hard-iron", "soft-iron") | {"left-by-ellipsoid": residual}


def result(estimate: Estimate, unit: str | None = None, per: float = 1.0) -> Result | Missing:
    """An estimate divided by `per` as a result; Missing if the data do not determine it."""
    if not estimate.identified:
        return Missing(estimate.why or "it is not identified")
    std = None if estimate.std is None else abs(estimate.std / per)
    return Result(estimate.value / per, estimate.unit if unit is None else unit, std)
