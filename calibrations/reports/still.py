"""The report on a noise model: one HTML page with verdict, falling error, both pictures and the coefficients."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from calibrations.model import Estimate
from calibrations.numerals import chance, measured, plain, unit
from calibrations.pictures.album import Picture
from calibrations.reports.page import figure, page
from calibrations.reports.words import capital, joined
from calibrations.still.compare import Comparison
from calibrations.still.diagnose import Diagnosis
from calibrations.still.discover import Discovery
from calibrations.still.documents import mismatch
from calibrations.still.fit import NoiseFit
from calibrations.still.held_out import held_out_excess
from calibrations.still.words import doubt, of_record

VERDICTS = {
    "adequate": "nothing missing",
    "found": "noise found",
    "ambiguous": "not decided",
    "unexplained": "not explained",
}


def still_report(
    found: Discovery, first: Diagnosis, beside: Comparison, date: str, program: str, pictures: Iterable[Picture]
) -> str:
    """The page as HTML text; the same arguments give the same page."""
    state = "found" if found.verdict == "adequate" and found.steps else found.verdict
    return page(
        "still.html",
        headline=_headline(found),
        verdict=VERDICTS[state],
        state=state,
        what=f"Noise report, model {found.start.model.name}",
        summary=_summary(found),
        figures=_figures(found),
        pictures=[figure(picture) for picture in pictures],
        steps=list(_steps(found)),
        fails=[capital(place.text) for place in beside.fails],
        given=found.start.model.name,
        candidates=[
            {
                "name": c.name,
                "gain": plain(c.gain / 2),
                "seen": plain(c.after.pooled_excess),
                "unseen": plain(c.held_out_after),
                "p": chance(c.p_value),
                "rivals": ", ".join(c.indistinguishable_from) or "–",
            }
            for c in first.candidates
        ],
        model=found.end.model.name,
        parameters=[(term.name, _estimate(e)) for term in found.end.model.terms for e in term.estimates],
        next=found.next_experiment,
        provenance=_provenance(found, date, program),
    )


def _headline(found: Discovery) -> str:
    model = found.start.model.name
    if found.verdict == "unexplained":
        beside = f"Beside {joined(found.causes)}, the" if found.causes else "The"
        return f"{beside} record holds something that no mixture of noise is."
    if not found.steps:
        return f"Nothing is missing from the noise model {model}."
    doubts = [f"{a} cannot be told from {joined(b, 'or')}" for a, b in found.alternatives.items()]
    text = f"The noise model {model} misses {joined(found.causes)}"
    if doubts:
        return f"{text}; on this record {joined(doubts)}."
    return f"{text}, and something is left." if found.verdict == "ambiguous" else f"{text}."


def _summary(found: Discovery) -> str:
    text = capital(of_record(found.start.still)) + ". "
    if found.steps:
        text += (
            f"With {joined(found.causes)} the mismatch of the spectrum falls from {plain(found.start.pooled_excess)} "
            f"to {plain(found.end.pooled_excess)} times what chance leaves, and that of the Allan deviation from "
            f"{_off(found.start)} to {_off(found.end)}."
        )
    else:
        text += f"The spectrum differs from the model's by {plain(found.start.pooled_excess)} times what chance leaves."
    if found.verdict == "ambiguous":
        return text + doubt(found.reason)
    return f"{text} Left over: {found.residual_structure}." if found.residual_structure else text


def _off(found: NoiseFit) -> str:
    return joined(f"{plain(100 * value, 2)} % ({axis})" for axis, value in mismatch(found).items())


def _figures(found: Discovery) -> list[tuple[str, str, str]]:
    remark = "mismatch of the spectrum over that by chance"
    shown = [("before" if found.steps else "mismatch", plain(found.start.pooled_excess), remark)]
    if found.steps:
        gained = found.end.log_likelihood - found.start.log_likelihood
        shown.append(("after", plain(found.end.pooled_excess), remark))
        shown.append(("log-likelihood", f"+{plain(gained)}", "gained by the effects added"))
    return shown


def _steps(found: Discovery) -> Iterable[dict[str, str]]:
    """Rows whose gains add up; beside them what the whole loses without each alone."""
    start, cleaned = found.start, found.cleaned
    yield _step(start.model.name, start)
    if cleaned is not None:
        yield _step("less what no noise is", cleaned, cleaned.log_likelihood - start.log_likelihood)
    for step in found.steps:
        yield _step(f"+ {step.name}", step.after, step.gained, step.alone)


def _step(name: str, fit: NoiseFit, gained: float | None = None, alone: float | None = None) -> dict[str, str]:
    return {
        "name": name,
        "gained": "–" if gained is None else plain(gained),
        "alone": "–" if alone is None else plain(alone),
        "seen": plain(fit.pooled_excess),
        "unseen": plain(held_out_excess(fit.model, fit.still)),
        "allan": _off(fit),
    }


def _estimate(e: Estimate) -> dict[str, str]:
    row = {"name": e.name.replace("_", " "), "axis": e.axis}
    if not e.identified:
        return row | {"value": f"not identified: {e.why}", "unit": ""}
    return row | {"value": measured(e.value, e.std), "unit": unit(e.unit)}


def _provenance(found: Discovery, date: str, program: str) -> dict[str, Any]:
    still, given = found.start.still, found.start.model
    return {
        "data": still.source.replace("\\", "/").rpartition("/")[2],
        "kind and size": f"still record, {still.n} samples of {len(still.channels)} channels at {still.rate_hz:.6g} Hz",
        "SHA-256 of the samples": still.digest,
        **{f"constant {name}": str(value) for name, value in still.constants.items()},
        "model given": given.name,
        **{f"model given: {name}": str(value) for name, value in given.provenance.items()},
        "program": program,
        "date": date,
    }
