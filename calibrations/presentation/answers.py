"""Comparison, diagnosis and discovery in words: what a terminal prints and a notebook shows."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from calibrations.discovery.results import Comparison, Diagnosis, Discovery
from calibrations.documents import places_document, why
from calibrations.text import columns, quantity

MOST_CANDIDATES = 6
SELF_JUDGED = "The noise is known from this residual only, so that the error alone shows no failure."


def comparison_text(result: Comparison[Any]) -> str:
    """The error of each channel, and the places where the model fails."""
    data = result.data
    parts = [f"{result.fit.model.name} on {data.description}", columns(*data.error_table(result.fit))]
    if (further := data.comparison_table(result)) is not None:
        parts.append(columns(*further))
    if result.rejection is not None:
        parts.append(f"This data cannot be used: {result.rejection.verdict}: {result.rejection.text}.")
    elif result.given is not None:
        parts.append(f"{SELF_JUDGED} {result.given.text}")
    elif result.adequate:
        parts.append(data.complete if data.noise_known(result.fit) else SELF_JUDGED)
    else:
        parts.append("The model fails here, worst first:\n" + "\n".join(f"  {place.text}" for place in result.fails))
    return "\n\n".join(parts)


def diagnosis_text(result: Diagnosis[Any], model: str = "") -> str:
    """The verdict on the given model, its candidates, and the best of them. `model`: another name for the model."""
    data = result.findings.data
    parts = [f"{model or result.fit.model.name} on {data.description}", result.judgement.text]
    if shown := result.candidates[:MOST_CANDIDATES]:
        parts.append(columns(*data.candidate_table(result, shown)))
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
    lines = [result.judgement.text, *data.remarks(result.end), *experiment]
    lines += [f"But {result.caution}."] if result.caution else []
    parts = [columns(*data.step_table(result)), "\n".join(lines)]
    if result.findings.places:
        parts.insert(1, _places(result))
    return "\n\n".join(parts)


def _places(result: Discovery[Any]) -> str:
    """Where something acts, how much, and why."""
    rows = [
        (
            place["place"],
            ", ".join(place["explained_by"]) or "unknown form",
            quantity(place["size"], place["unit"]),
            f"{place['size_over_floor']:.3g}",
            f"{100 * place['share']:.2g} %",
            ", ".join(place["inseparable_from"]) or "-",
        )
        for place in places_document(result)
    ]
    return columns(("place", "effect", "size", "size / floor", "share", "cannot be separated from"), rows)
