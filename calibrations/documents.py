"""Results as documents: plain mappings of the schemas that other people's programs read. JSON numbers, never NaN.

They are the same for every kind of data; `Dataset` adds the fields that one kind alone has.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from calibrations.discovery.dataset import Dataset
from calibrations.discovery.findings import Candidate, F, Step
from calibrations.discovery.results import Comparison, Diagnosis, Discovery
from calibrations.discovery.verdict import Finding
from calibrations.model import Model
from calibrations.table import Array

if TYPE_CHECKING:
    from calibrations.design.expected import ExpectedResult
    from calibrations.design.experiment import Experiment
    from calibrations.discovery.curves import PlaceCurve

Document = dict[str, Any]


def fit_document(data: Dataset[F], fitted: F, path: str | None) -> Document:
    """`rig.fit/1`."""
    return {
        "schema": "rig.fit/1",
        "data": data.source,
        "parameters": parameters_document(fitted.model),
        "n": data.n,
        **data.errors_document(fitted),
        **_reason_document(data.rejection(fitted)),
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


def comparison_document(result: Comparison[F], model: str) -> Document:
    """`rig.comparison/1`."""
    return {
        "schema": "rig.comparison/1",
        "data": result.data.source,
        "model": model,
        "n": result.data.n,
        **result.data.errors_document(result.fit),
        **result.data.comparison_fields(result),
        "fails": [
            {"where": p.where, "from": p.low, "to": p.high, "axis": p.axis, "excess": p.excess, "text": p.text}
            for p in result.fails
        ],
        **_reason_document(result.rejection),
        "missing": list(result.given.missing) if result.given is not None else None,
    }


def _reason_document(reason: Finding | None) -> Document:
    """A verdict and its reason on data that cannot be used; both null where they can be."""
    return {
        "verdict": reason.verdict if reason else None,
        "residual_structure": reason.text if reason else None,
    }


def diagnosis_document(result: Diagnosis[F], model: str) -> Document:
    """`rig.diagnosis/1`: the verdict is that of the given model."""
    return {
        "schema": "rig.diagnosis/1",
        "data": result.findings.data.source,
        "model": model,
        "verdict": result.verdict.value,
        "text": result.judgement.text,
        "missing": list(result.missing),
        "provisional": result.judgement.provisional,
        "candidates": [_candidate(c, result) for c in result.candidates],
        **_doubt_fields(result),
    }


def discovery_document(result: Discovery[F], path: str | None) -> Document:
    """`rig.discovery/1`: the verdict is that of the final model."""
    return {
        "schema": "rig.discovery/1",
        "data": result.findings.data.source,
        "verdict": result.verdict.value,
        "text": result.judgement.text,
        "steps": _steps(result),
        "summary": _summary(result),
        "causes": list(result.causes),
        "refinements": list(result.refinements),
        **_doubt_fields(result),
        "model": path,
    }


def _steps(result: Discovery[F]) -> list[Document]:
    """The steps, with their shares where the search has shares."""
    data = result.findings.data
    steps = [step_document(step, data) for step in result.steps]
    shares = data.step_shares(result)
    return [step | {"share": share} for step, share in zip(steps, shares, strict=True)] if shares else steps


def _summary(result: Discovery[F]) -> list[Document]:
    """A line for each place that acts, and for each further effect that was added; none for a still record."""
    return [
        {
            "place": line.place,
            "effects": list(line.effects),
            "possible_effects": list(line.possible),
            "size": line.size,
            "unit": line.unit,
            "share": line.share,
            "certainty": line.certainty,
            "in_another_form": line.in_another_form,
            "inseparable_from": list(line.inseparable_from),
        }
        for line in result.findings.data.summary(result)
    ]


def _doubt_fields(result: Diagnosis[F] | Discovery[F]) -> Document:
    """The fields on undecided matters, which both documents have."""
    return {
        "alternatives": {name: list(names) for name, names in result.alternatives.items()},
        "reason": result.reason,
        "disturbances": [dict(disturbance) for disturbance in result.findings.disturbances],
        "places": places_document(result),
        "residual_structure": result.residual_structure,
        "left_out": list(result.findings.data.left_out),
        "outliers": list(result.outliers),
        "next_experiment": experiment_document(result.next_experiment),
    }


def places_document(result: Diagnosis[F] | Discovery[F]) -> list[Document]:
    """The places of the signal chain that act, the largest first; none where the search has no places."""
    acting_places, data = result.findings.places, result.findings.data
    total = sum(place.rms**2 for place in acting_places) or 1.0
    curves = data.place_curves(result.findings)
    return [
        {
            "place": place.name,
            "axes": list(data.axes),
            "size": place.rms,
            "unit": data.unit,
            "size_over_floor": place.size,
            "share": place.rms**2 / total,
            "p_value": place.p_value,
            "explained_by": list(place.causes),
            "explained_share": place.share if place.causes else 0.0,
            "inseparable_from": list(place.inseparable_from),
            **_curve_fields(curves.get(place.name), bool(place.causes)),
        }
        for place in acting_places
    ]


def _curve_fields(curve: PlaceCurve | None, explained: bool) -> Document:
    """The curve of a place, its symmetry, and an expression if its form is unknown; null without a place."""
    if curve is None:
        return {"symmetry": None, "expression": None, "curve": None}
    grid = curve.at[curve.largest]  # one grid for all axes

    def on_grid(values: Mapping[str, Array]) -> Document:
        return {axis: np.interp(grid, curve.at[axis], samples).tolist() for axis, samples in values.items()}

    document = {
        "driver": curve.driver,
        "driver_unit": curve.driver_unit,
        "unit": curve.unit,
        "at": grid.tolist(),
        "value": on_grid(curve.value),
        "std": on_grid(curve.std),
    }
    expression = None if explained else curve.expression
    return {"symmetry": curve.symmetry or None, "expression": expression, "curve": document}


def step_document(step: Step[F], data: Dataset[F]) -> Document:
    """One step of a discovery."""
    return {
        "added": step.name,
        "excess_before": step.before.pooled_excess,
        "excess_after": step.after.pooled_excess,
        "held_out_before": step.held_out_before,
        "held_out_after": step.held_out_after,
        **data.step_fields(step),
    }


def _candidate(c: Candidate, result: Diagnosis[F]) -> Document:
    return {
        "effect": c.name,
        "axes": list(result.findings.data.axes),
        "excess_before": result.excess_before,
        "excess_after": c.excess_after,
        "held_out_before": result.held_out_before,
        "held_out_after": c.held_out_after,
        **result.findings.data.candidate_fields(c),
        "p_value": c.p_value,
        "probability": c.probability,
        "indistinguishable_from": list(c.indistinguishable_from),
        "why": why(c, result),
    }


def why(c: Candidate, result: Diagnosis[F]) -> str:
    """The candidate in words: its summary, its symptom, and the change of the held-out error when it is added."""
    data, error_before = result.findings.data, result.held_out_before
    fall = f"changes the error on {data.unseen} from {error_before:.3g} to {c.held_out_after:.3g} times {data.floor}"
    if c.held_out_after >= error_before:
        fall = f"does not lower the error on {data.unseen} ({error_before:.3g} times {data.floor})"
    return f"{c.effect.summary} Symptom: {c.effect.symptom} Adding it {fall}."


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
        "expected": _expected_document(e.expected),
    }


def _expected_document(expected: ExpectedResult | None) -> Document | None:
    """Distances in standard deviations; null where they are not computed."""
    if expected is None:
        return None
    alone_document = {"deviations": float(np.sqrt(expected.alone)), "probability": expected.probability_alone}
    return {"deviations": expected.deviations, "probability": expected.probability, "alone": alone_document}
