"""The report on a noise model: one HTML page with verdict, mismatch by model, pictures and coefficients."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from calibrations.discovery.results import Comparison, Discovery
from calibrations.model import Estimate
from calibrations.noise.dataset import CLEANED, mismatch
from calibrations.noise.fit import NoiseFit
from calibrations.noise.record import of_record
from calibrations.presentation.chart import Picture
from calibrations.presentation.report.page import figure, page
from calibrations.text import capital, estimate_text, joined, probability, rounded, unit


def still_report(
    found: Discovery[NoiseFit], beside: Comparison[NoiseFit], date: str, program: str, pictures: Iterable[Picture]
) -> str:
    """The page as HTML text; the same arguments give the same page."""
    return page(
        "still.html",
        headline=found.judgement.headline,
        verdict=found.outcome.label,
        state=found.outcome.value,
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
                "gain": rounded(c.gain / 2),
                "seen": rounded(c.excess_after),
                "unseen": rounded(c.held_out_after),
                "p": probability(c.p_value),
                "rivals": ", ".join(c.indistinguishable_from) or "–",
            }
            for c in found.findings.candidates
        ],
        model=found.end.model.name,
        parameters=[(term.name, _estimate(e)) for term in found.end.model.terms for e in term.estimates],
        next=found.next_experiment,
        provenance=_provenance(found, date, program),
    )


def _summary(found: Discovery[NoiseFit]) -> str:
    text = capital(of_record(found.start.still)) + ". "
    if found.steps:
        text += (
            f"With {joined(found.causes)} the mismatch of the spectrum falls from {rounded(found.start.pooled_excess)} "
            f"to {rounded(found.end.pooled_excess)} times the scatter by chance, and that of the Allan deviation from "
            f"{_off(found.start)} to {_off(found.end)}."
        )
    else:
        text += f"The mismatch of the spectrum is {rounded(found.start.pooled_excess)} times the scatter by chance."
    return f"{text} {found.judgement.text}"


def _off(found: NoiseFit) -> str:
    return joined(f"{rounded(100 * value, 2)} % ({axis})" for axis, value in mismatch(found).items())


def _figures(found: Discovery[NoiseFit]) -> list[tuple[str, str, str]]:
    remark = "mismatch of the spectrum, relative to chance"
    shown = [("before" if found.steps else "mismatch", rounded(found.start.pooled_excess), remark)]
    if found.steps:
        gained = found.end.log_likelihood - found.start.log_likelihood
        shown.append(("after", rounded(found.end.pooled_excess), remark))
        shown.append(("log-likelihood", f"+{rounded(gained)}", "gained by the effects added"))
    return shown


def _steps(found: Discovery[NoiseFit]) -> Iterable[dict[str, str]]:
    """Rows of the steps: the gains, which add up, and the loss of the whole without each effect alone."""
    start, baseline = found.start, found.findings.baseline
    yield _step(start.model.name, start)
    if baseline is not start:
        yield _step(CLEANED, baseline, baseline.log_likelihood - start.log_likelihood)
    for step in found.steps:
        yield _step(f"+ {step.name}", step.after, step.after.log_likelihood - step.before.log_likelihood, step.alone)


def _step(name: str, fit: NoiseFit, gained: float | None = None, alone: float | None = None) -> dict[str, str]:
    return {
        "name": name,
        "gained": "–" if gained is None else rounded(gained),
        "alone": "–" if alone is None else rounded(alone),
        "seen": rounded(fit.pooled_excess),
        "unseen": rounded(fit.held_out_excess),
        "allan": _off(fit),
    }


def _estimate(e: Estimate) -> dict[str, str]:
    row = {"name": e.name.replace("_", " "), "axis": e.axis}
    if not e.identified:
        return row | {"value": f"not identified: {e.why}", "unit": ""}
    return row | {"value": estimate_text(e.value, e.std), "unit": unit(e.unit)}


def _provenance(found: Discovery[NoiseFit], date: str, program: str) -> dict[str, Any]:
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
