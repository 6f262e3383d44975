"""The report on a noise model: one HTML page with verdict, mismatch by model, pictures and coefficients."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from calibrations.discovery.results import Comparison, Discovery
from calibrations.noise.analysis import NoiseAnalysis
from calibrations.noise.comparison import mismatch
from calibrations.noise.dataset import NoiseFindings
from calibrations.noise.fit import NoiseFit
from calibrations.noise.record import of_record
from calibrations.presentation.chart import Picture
from calibrations.presentation.document import Block, Code, Items, Page, Remark, Section, Table
from calibrations.presentation.noise_text import typeset_coefficients
from calibrations.presentation.page import html
from calibrations.presentation.report.parameters import constant_facts, estimate_cells, model_facts, name_of_file
from calibrations.presentation.views.still import gains
from calibrations.text import capital, join_words, probability, rounded, typeset

MISMATCH = (
    "Mismatch: rms difference between the spectrum and the model, relative to the scatter by chance. Other half: the "
    "model is fitted to one half of the record and compared with the other. The gain of a step depends on the steps "
    "above it, and gains add up. The losses without one effect do not add up."
)
PLACES = (
    "Largest first. The p-values of neighbouring averaging times are correlated; the limit holds for any correlation."
)
NO_PLACE = "No averaging time and no frequency differs from the model by more than chance."
ALONE = (
    "Each effect is added alone to the given model. p-value: the probability of such a gain anywhere in the search if "
    "no effect is missing."
)

COEFFICIENTS = (
    "By all processes that the search found, without the disturbances that could be removed. The digits in brackets "
    "are the standard uncertainty of the last digits. N, B, K and Q are the usual symbols of these coefficients."
)


def still_report(
    discovery: Discovery[NoiseFit],
    comparison: Comparison[NoiseFit],
    date: str,
    program: str,
    pictures: Iterable[Picture],
) -> str:
    """The page as HTML text; the same arguments give the same page."""
    return html(
        Page(
            headline=typeset(discovery.judgement.headline),
            verdict=discovery.outcome.label,
            state=discovery.outcome.value,
            subject=f"Noise report, model {discovery.start.model.name}",
            summary=_summary(discovery),
            figures=_figures(discovery),
            sections=list(_sections(discovery, comparison, list(pictures))),
            provenance=_provenance(discovery, date, program),
        )
    )


def _sections(
    discovery: Discovery[NoiseFit], comparison: Comparison[NoiseFit], pictures: Sequence[Picture]
) -> Iterable[Section]:
    head = (
        "model", "log-likelihood gained", "lost without this effect", "mismatch / chance", "other half of the record",
        "mismatch of the Allan deviation",
    )  # fmt: skip
    steps = Table(
        "Mismatch by model, values", head, [_step(*row) for row in gains(discovery)], range(1, 6), headed=False
    )
    yield Section("Mismatch by model", (steps, Remark(MISMATCH)))
    yield Section("Measurement and model", pictures)
    fails = [capital(typeset(place.text)) for place in comparison.fails]
    name = discovery.start.model.name
    yield Section(f"Mismatch of the model {name}", (PLACES, Items(fails)) if fails else (NO_PLACE,))
    if discovery.findings.candidates:
        yield Section("Candidates", _candidates(discovery))
    estimates = discovery.end.model.all_estimates
    rows = [(term.name, e.name.replace("_", " "), e.axis, *estimate_cells(e)) for term, e in estimates]
    coefficients = ("effect", "parameter", "axis", "value (standard uncertainty)", "unit")
    title = "The model, extended" if discovery.steps else "The model"
    yield Section(title, (discovery.end.model.name, Table("Coefficients", coefficients, rows, headed=False)))
    yield from _noise_coefficients(discovery)
    if (experiment := discovery.next_experiment) is not None:
        yield Section("Next experiment", (f"{capital(experiment.why)}.", Code(experiment.command)))


def _noise_coefficients(discovery: Discovery[NoiseFit]) -> Iterable[Section]:
    """N, B, K and further coefficients by the processes that the search found: those of `rig noise`."""
    findings = discovery.findings
    if not isinstance(findings, NoiseFindings):
        return
    still, blocks = discovery.start.still, list[Block]()
    for axis, noise in NoiseAnalysis(still, findings.search).channels.items():
        (head, rows), density = typeset_coefficients(noise, still.sensed.get(axis))
        blocks += [Table(f"Axis {axis}", head, rows), density]
    yield Section("Noise coefficients", (*blocks, Remark(COEFFICIENTS)))


def _candidates(discovery: Discovery[NoiseFit]) -> tuple[Block, ...]:
    rows = [
        (
            c.name,
            rounded(c.gain / 2),
            rounded(c.excess_after),
            rounded(c.held_out_after),
            probability(c.p_value),
            ", ".join(c.indistinguishable_from) or "–",
        )
        for c in discovery.findings.candidates
    ]
    head = (
        "effect", "log-likelihood", "mismatch / chance", "other half of the record", "p-value", "inseparable from",
    )  # fmt: skip
    return Table("Candidates", head, rows, range(1, 5), headed=False), Remark(ALONE)


def _summary(discovery: Discovery[NoiseFit]) -> str:
    text = capital(of_record(discovery.start.still)) + ". "
    start, end = discovery.start, discovery.end
    if discovery.steps:
        text += (
            f"With {join_words(discovery.causes)} the mismatch of the spectrum falls from "
            f"{rounded(start.pooled_excess)} to {rounded(end.pooled_excess)} times the scatter by chance, and that of "
            f"the Allan deviation from {_mismatch_text(start)} to {_mismatch_text(end)}."
        )
    return f"{text} {typeset(discovery.judgement.text)}"


def _mismatch_text(fit: NoiseFit) -> str:
    return join_words(f"{rounded(100 * value, 2)} % ({axis})" for axis, value in mismatch(fit).items())


def _figures(discovery: Discovery[NoiseFit]) -> list[tuple[str, str, str]]:
    remark = "mismatch of the spectrum, relative to chance"
    figures = [("before" if discovery.steps else "mismatch", rounded(discovery.start.pooled_excess), remark)]
    if discovery.steps:
        gained = discovery.end.log_likelihood - discovery.start.log_likelihood
        figures.append(("after", rounded(discovery.end.pooled_excess), remark))
        figures.append(("log-likelihood", f"+{rounded(gained)}", "gained by the effects added"))
    return figures


def _step(name: str, gained: float | None, loss: float | None, fit: NoiseFit) -> tuple[str, ...]:
    likelihoods = ("–" if value is None else rounded(value) for value in (gained, loss))
    return name, *likelihoods, rounded(fit.pooled_excess), rounded(fit.held_out_excess), _mismatch_text(fit)


def _provenance(discovery: Discovery[NoiseFit], date: str, program: str) -> dict[str, str]:
    still, model = discovery.start.still, discovery.start.model
    return {
        "data": name_of_file(still.source),
        "kind and size": f"still record, {still.n} samples of {len(still.channels)} channels at {still.rate_hz:.6g} Hz",
        "SHA-256 of the samples": still.digest,
        **constant_facts(still.constants),
        **model_facts(model),
        "program": program,
        "date": date,
    }
