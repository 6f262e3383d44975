"""Results on still records as documents of the same schemas as those of poses.

`rmse` is the rms mismatch of the spectrum, as a share of it, each band weighted by its degrees of freedom;
`noise_floor` is what chance alone leaves of that, and `excess` their ratio. There is no `slow_noise`: it is what the
model is about.
"""

from __future__ import annotations

from typing import Any

from calibrations.documents import experiment_document, parameters_document, places_document
from calibrations.noise_analysis.document import coefficients_document
from calibrations.still.allan import averaged
from calibrations.still.compare import Comparison
from calibrations.still.diagnose import Candidate, Diagnosis
from calibrations.still.discover import Added, Discovery
from calibrations.still.disturbed import Disturbed
from calibrations.still.fit import NoiseFit
from calibrations.still.patterns import Pattern
from calibrations.still.search import Search
from calibrations.still.telegraph import TWO_LEVELS

Document = dict[str, Any]


def fit_document(found: NoiseFit, path: str | None) -> Document:
    """`rig.fit/1`."""
    return {
        "schema": "rig.fit/1",
        "data": found.still.source,
        "parameters": parameters_document(found.model),
        "n": found.still.n,
        **_errors(found),
        "model": path,
    }


def comparison_document(result: Comparison, model: str) -> Document:
    """`rig.comparison/1`, with the Allan deviations that are compared."""
    curves = {
        each.channel.axis: {
            "tau_s": curve.tau_s.tolist(),
            "deviation": curve.measured.tolist(),
            "low": curve.low.tolist(),
            "high": curve.high.tolist(),
            "model": curve.modelled.tolist(),
        }
        for each, curve in zip(result.fit.channels, result.averaged, strict=True)
    }
    return {
        "schema": "rig.comparison/1",
        "data": result.fit.still.source,
        "model": model,
        "n": result.fit.still.n,
        **_errors(result.fit),
        "allan": curves,
        "fails": places_document(result.fails),
    }


def diagnosis_document(result: Diagnosis, model: str) -> Document:
    """`rig.diagnosis/1`."""
    return {
        "schema": "rig.diagnosis/1",
        "data": result.fit.still.source,
        "model": model,
        "verdict": result.verdict,
        "candidates": [_candidate(c, result) for c in result.candidates],
        "alternatives": {name: list(names) for name, names in result.alternatives.items()},
        "reason": result.reason,
        "disturbances": disturbances(result.search),
        "residual_structure": result.residual_structure,
        "next_experiment": experiment_document(result.next_experiment),
    }


def discovery_document(result: Discovery, path: str | None) -> Document:
    """`rig.discovery/1`."""
    return {
        "schema": "rig.discovery/1",
        "data": result.start.still.source,
        "verdict": result.verdict,
        "steps": [_step(step) for step in result.steps],
        "causes": list(result.causes),
        "refinements": [],
        "alternatives": {name: list(names) for name, names in result.alternatives.items()},
        "reason": result.reason,
        "disturbances": disturbances(result.search),
        "residual_structure": result.residual_structure,
        "next_experiment": experiment_document(result.next_experiment),
        "model": path,
    }


def disturbances(found: Search) -> list[Document]:
    """What no noise is: what was taken off the record, then odd samples; between them, noise of two levels."""
    odd = [(each.axis, oddity) for each in found.still.channels for oddity in each.oddities]
    two = [{"kind": TWO_LEVELS, "axis": t.axis, "text": t.text, "matters": False} for t in found.telegraphs]
    return [
        *map(_pattern, found.patterns),
        *two,
        *({"kind": each.kind, "axis": axis, "text": each.text, "matters": each.matters} for axis, each in odd),
    ]


def disturbed_document(found: Disturbed) -> Document:
    """Beside a noise analysis: what no noise is, and the coefficients without what could be taken off."""
    return {
        "disturbances": [
            {"kind": d.kind, "text": d.text, "spoils": list(d.spoils), "matters": d.matters} for d in found.disturbances
        ],
        "coefficients_without": None if found.rest is None else coefficients_document(found.rest),
    }


def _pattern(pattern: Pattern) -> Document:
    return {
        "kind": pattern.kind,
        "axis": pattern.axis,
        "text": pattern.plain,
        "matters": True,
        "column": pattern.cause or None,
        "value": pattern.size,
        "std": pattern.std,
        "cannot_be_told_from": [rival.plain for rival in pattern.rivals],
    }


def mismatch(found: NoiseFit) -> dict[str, float]:
    """Rms of the logarithm of measured over modelled Allan deviation, by axis."""
    return {each.channel.axis: averaged(each, found.still.allan[each.channel.axis]).mismatch for each in found.channels}


def why(c: Candidate, result: Diagnosis) -> str:
    """The candidate in words: what it is, what it would look like, and what adding it does here."""
    before, after = result.held_out_before, c.held_out_after
    fall = (
        f"adding it lowers the mismatch on the other half of the record from {before:.3g} to {after:.3g} x chance"
        if after < before
        else f"adding it does not lower the mismatch on the other half of the record ({before:.3g} x chance)"
    )
    return f"{c.effect.summary} Symptom: {c.effect.symptom} Here {fall}."


def _errors(found: NoiseFit) -> Document:
    each = {channel.channel.axis: channel for channel in found.channels}
    return {
        "rmse": {axis: channel.mismatch for axis, channel in each.items()},
        "noise_floor": {axis: channel.floor for axis, channel in each.items()},
        "excess": {axis: channel.excess for axis, channel in each.items()},
        "log_likelihood": {axis: channel.log_likelihood for axis, channel in each.items()},
        "allan_mismatch": mismatch(found),
    }


def _candidate(c: Candidate, result: Diagnosis) -> Document:
    return {
        "effect": c.name,
        "axes": list(result.fit.still.axes),
        "excess_before": result.cleaned.pooled_excess,
        "excess_after": c.after.pooled_excess,
        "held_out_before": result.held_out_before,
        "held_out_after": c.held_out_after,
        "log_likelihood_gain": c.gain / 2,
        "p_value": c.p_value,
        "probability": c.probability,
        "indistinguishable_from": list(c.indistinguishable_from),
        "why": why(c, result),
    }


def _step(step: Added) -> Document:
    return {
        "added": step.name,
        "excess_before": step.before.pooled_excess,
        "excess_after": step.after.pooled_excess,
        "held_out_before": step.held_out_before,
        "held_out_after": step.held_out_after,
        "log_likelihood_before": step.before.log_likelihood,
        "log_likelihood_after": step.after.log_likelihood,
        "log_likelihood_alone": step.alone,
        "allan_mismatch_before": mismatch(step.before),
        "allan_mismatch_after": mismatch(step.after),
    }
