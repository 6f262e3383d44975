"""Fit, comparison, diagnosis and discovery in words, for a terminal and a notebook."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from calibrations.discovery.results import Comparison, Diagnosis, Discovery
from calibrations.discovery.summary import certainty_text
from calibrations.documents import places_document, why
from calibrations.fitting.fit import Fit
from calibrations.presentation.views import view_of
from calibrations.text import columns, quantity

MOST_CANDIDATES = 6
SELF_JUDGED = "The noise is known from this residual only, so that the error alone shows no failure."


def fit_text(result: Fit) -> str:
    """The parameters with their uncertainties, and the error of each channel with the noise floor."""
    unit, noise = result.problem.unit, result.noise
    errors = [
        (name, quantity(result.rmse[c], unit), quantity(noise.floor[c], unit), f"{result.excess[c]:.2f}")
        for c, name in enumerate(result.channels)
    ]
    head = f"{result.model.name}, fitted to {result.table.n} rows of {result.table.source}"
    floor = "noise floor" if noise.known else "scatter (noise floor not known)"
    return f"{head}\n\n{result.params}\n\n{columns(('axis', 'rms error', floor, 'error / floor'), errors)}"


def comparison_text(result: Comparison[Any]) -> str:
    """The error of each channel, and the places where the model fails."""
    data, view = result.data, view_of(result.data)
    parts = [f"{result.fit.model.name} on {data.description}", columns(*view.error_table(result.fit))]
    if (further := view.comparison_table(result)) is not None:
        parts.append(columns(*further))
    if result.rejection is not None:
        parts.append(f"This data cannot be used: {result.rejection.verdict}: {result.rejection.text}.")
    elif result.given is not None:
        parts.append(result.given.text if data.is_noise_known(result.fit) else f"{SELF_JUDGED} {result.given.text}")
    elif result.adequate:
        parts.append(data.complete if data.is_noise_known(result.fit) else SELF_JUDGED)
    else:
        parts.append("The model fails here, worst first:\n" + "\n".join(f"  {place.text}" for place in result.fails))
    return "\n\n".join(parts)


def diagnosis_text(result: Diagnosis[Any], model: str = "") -> str:
    """The verdict on the given model, its candidates, and the best of them. `model`: another name for the model."""
    data = result.findings.data
    parts = [f"{model or result.fit.model.name} on {data.description}", result.judgement.text]
    if listed := result.candidates[:MOST_CANDIDATES]:
        parts.append(columns(*view_of(data).candidate_table(result, listed)))
    if result.missing:
        best = result.candidates[0]
        parts += [
            f"{best.name}: {why(best, result)}",
            f"    {best.effect.formula.splitlines()[0].replace('{out}', result.findings.data.unit)}",
        ]
    return "\n\n".join(parts)


def discovery_text(result: Discovery[Any], experiment: Iterable[str] = ()) -> str:
    """The error after each step and the verdict. `experiment`: lines on the next one."""
    data = result.findings.data
    parts = [columns(*view_of(data).step_table(result)), discovery_verdict(result, experiment)]
    if summary := _summary(result):
        parts[1:1] = filter(None, [summary, unknown_text(result)])
    return "\n\n".join(parts)


def discovery_verdict(result: Discovery[Any], experiment: Iterable[str] = ()) -> str:
    """The verdict, remarks on it, and lines on the next experiment."""
    lines = [result.judgement.text, *result.findings.data.remarks(result.end), *experiment]
    return "\n".join([*lines, f"But {result.caution}."] if result.caution else lines)


def unknown_text(result: Discovery[Any]) -> str:
    """The curves of unknown form, a line each: symmetry, range, band, and an expression to add; "" without any."""
    lines = []
    for place in places_document(result):
        if place["explained_by"] or (curve := place["curve"]) is None:
            continue
        axis = max(curve["value"], key=lambda a: float(np.std(curve["value"][a])))
        axis = (place["expression"] or "")[1:2] if (place["expression"] or "")[:2] in ("vx", "vy", "vz") else axis
        value, band = np.array(curve["value"][axis]), float(np.mean(curve["std"][axis]))
        text = (
            f"Unknown form at {place['place']}: from {quantity(float(value.min()), curve['unit'])} to "
            f"{quantity(float(value.max()), curve['unit'])} ({axis}), standard uncertainty "
            f"{quantity(band, curve['unit'])} on average"
        )
        if place["symmetry"]:
            text += f"; {place['symmetry']}{' ' + curve['driver_unit'] if 'about' in place['symmetry'] else ''}"
        lines.append(f"{text}.")
        if place["expression"]:
            name = f"{place['place'].replace(':', '-').replace('_', '-')}-form"
            one_output = place["expression"].startswith(("vx +=", "vy +=", "vz +=")) and len(curve["value"]) > 1
            remark = " (one output; the others need the same with their own axes)" if one_output else ""
            lines.append(f"    It looks like: {place['expression']}{remark}")
            lines.append(
                f'    To add this expression in its place: rig add "{place["expression"]}" --name {name} --model MODEL '
                f"--data {result.findings.data.source} --out MODEL2"
            )
    return "\n".join(lines)


def _summary(result: Discovery[Any]) -> str:
    """The place that acts, the effect, its size and its certainty, as one sentence; "" if there is none."""
    rows = [
        (
            line.place,
            line.effect,
            f"{line.size:.3g} {line.unit}",
            f"{100 * line.share:.3g} %",
            certainty_text(line.certainty),
            ", ".join(line.inseparable_from) or "-",
        )
        for line in result.findings.data.summary(result)
    ]
    return columns(("place", "effect", "size", "share", "certainty", "cannot be separated from"), rows) if rows else ""
