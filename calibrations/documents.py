"""Results as documents: plain mappings of the schemas that other people's programs read. JSON numbers, never NaN."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol

import numpy as np

from calibrations.compare import Comparison, axis_of
from calibrations.design.expected import Expected
from calibrations.diagnose import Diagnosis
from calibrations.discover import Added, Discovery
from calibrations.experiment import Experiment
from calibrations.fit import Fit
from calibrations.model import Model
from calibrations.noise import rms
from calibrations.search.candidates import Candidate
from calibrations.table import Array

Document = dict[str, Any]


def fit_document(found: Fit, path: str | None) -> Document:
    """`rig.fit/1`."""
    return {
        "schema": "rig.fit/1",
        "data": found.table.source,
        "parameters": parameters_document(found.model),
        "n": found.table.n,
        "rmse": _by_channel(found, found.rmse),
        **_noise(found),
        "excess": _by_channel(found, found.excess),
        "model": path,
    }


def parameters_document(model: Model) -> list[Document]:
    """Every estimate of a model."""
    return [
        {
            "effect": term.name,
            "axis": e.axis or None,
            "name": e.name,
            "value": e.value,
            "std": e.std,
            "unit": e.unit,
            "identified": e.identified,
            "why": e.why,
        }
        for term in model.terms
        for e in term.estimates
    ]


def comparison_document(result: Comparison, model: str) -> Document:
    """`rig.comparison/1`."""
    found = result.fit
    return {
        "schema": "rig.comparison/1",
        "data": found.table.source,
        "model": model,
        "n": found.table.n,
        "rmse": _by_channel(found, found.rmse),
        **_noise(found),
        "excess": _by_channel(found, found.excess),
        "fails": places_document(result.fails),
    }


class Failing(Protocol):
    """A place where a model fails, of poses or of a still record."""

    @property
    def where(self) -> str: ...
    @property
    def low(self) -> float: ...
    @property
    def high(self) -> float: ...
    @property
    def axis(self) -> str: ...
    @property
    def excess(self) -> float: ...
    @property
    def text(self) -> str: ...


def places_document(fails: Iterable[Failing]) -> list[Document]:
    """Where a model fails."""
    return [
        {"where": p.where, "from": p.low, "to": p.high, "axis": p.axis, "excess": p.excess, "text": p.text}
        for p in fails
    ]


def diagnosis_document(result: Diagnosis, model: str) -> Document:
    """`rig.diagnosis/1`."""
    return {
        "schema": "rig.diagnosis/1",
        "data": result.fit.table.source,
        "model": model,
        "verdict": result.verdict,
        "candidates": [_candidate(c, result) for c in result.candidates],
        "residual_structure": result.residual_structure,
        "outliers": list(result.path.outliers),
        "next_experiment": experiment_document(result.next_experiment),
    }


def discovery_document(result: Discovery, path: str | None) -> Document:
    """`rig.discovery/1`."""
    return {
        "schema": "rig.discovery/1",
        "data": result.start.table.source,
        "verdict": result.verdict,
        "steps": [added_document(step) for step in result.steps],
        "causes": list(result.causes),
        "refinements": list(result.refinements),
        "alternatives": {name: list(names) for name, names in result.alternatives.items()},
        "residual_structure": result.residual_structure,
        "outliers": list(result.path.outliers),
        "next_experiment": experiment_document(result.next_experiment),
        "model": path,
    }


def added_document(step: Added) -> Document:
    """One step of a discovery."""
    return {
        "added": step.name,
        "excess_before": step.before.pooled_excess,
        "excess_after": step.after.pooled_excess,
        "held_out_before": step.held_out_before,
        "held_out_after": step.held_out_after,
    }


def _noise(found: Fit) -> Document:
    return {
        "noise_floor": _by_channel(found, found.noise.floor),
        "slow_noise": _by_channel(found, found.noise.slow),
    }


def _by_channel(found: Fit, values: Array) -> dict[str, float]:
    """The parts of a motion are brought together by axis: their root mean square."""
    by_axis: dict[str, list[float]] = {}
    for channel, value in zip(found.channels, np.asarray(values), strict=True):
        by_axis.setdefault(axis_of(channel), []).append(float(value))
    return {axis: each[0] if len(each) == 1 else float(rms(np.array(each))) for axis, each in by_axis.items()}


def _candidate(c: Candidate, result: Diagnosis) -> Document:
    return {
        "effect": c.name,
        "axes": list(result.fit.table.axes),
        "excess_before": result.excess_before,
        "excess_after": c.excess_after,
        "held_out_before": result.held_out_before,
        "held_out_after": c.held_out_after,
        "p_value": c.p_value,
        "probability": c.probability,
        "indistinguishable_from": list(c.indistinguishable_from),
        "why": why(c, result),
    }


def why(c: Candidate, result: Diagnosis) -> str:
    """The candidate in words: what it is, what it would look like, and what adding it does here."""
    fall = f"adding it lowers the error on unseen poses from {result.held_out_before:.3g} to {c.held_out_after:.3g}"
    if c.held_out_after >= result.held_out_before:
        fall = f"adding it does not lower the error on unseen poses ({result.held_out_before:.3g} x the noise floor)"
    else:
        fall += " x the noise floor"
    return f"{c.effect.summary} Symptom: {c.effect.symptom} Here {fall}."


def experiment_document(e: Experiment | None) -> Document | None:
    if e is None:
        return None
    return {
        "procedure": e.procedure,
        "settings": dict(e.settings),
        "separates": [list(pair) for pair in e.separates],
        "why": e.why,
        "command": e.command or None,
        "duration_s": e.duration_s,
        "expected": _expected(e.expected),
    }


def _expected(found: Expected | None) -> Document | None:
    """Distances in standard deviations; null where they are not computed."""
    if found is None:
        return None
    alone = {"deviations": float(np.sqrt(found.alone)), "probability": found.probability_alone}
    return {"deviations": found.deviations, "probability": found.probability, "alone": alone}
