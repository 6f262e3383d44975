"""The report: one HTML page that needs no network, with verdict, falling error, candidates, model, noise, provenance.

Every uncertain number has its uncertainty, or states that it is unknown.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from markupsafe import Markup

from calibrations.analyses.motion import MotionResult
from calibrations.criteria import SIGNIFICANT
from calibrations.design.experiment import Experiment
from calibrations.discovery.findings import Candidate
from calibrations.discovery.results import Comparison, Discovery
from calibrations.discovery.summary import probability_text
from calibrations.discovery.verdict import refinement_text
from calibrations.fitting.fit import Fit, in_milli, milli_unit, pool_in_milli
from calibrations.model import Term
from calibrations.presentation.budget import budget_section
from calibrations.presentation.chart import Picture
from calibrations.presentation.charts.discovery import album, brief, error_text
from calibrations.presentation.document import Block, Code, Items, Page, Remark, Section, Table
from calibrations.presentation.formula import formula_html
from calibrations.presentation.page import html
from calibrations.presentation.report.motion import motion_page
from calibrations.presentation.report.parameters import (
    constant_facts,
    estimate_cells,
    matrices_section,
    model_facts,
    name_of_file,
    verdicts,
)
from calibrations.presentation.residual import column_label
from calibrations.presentation.views.view import ONLY_ONE
from calibrations.table import Array
from calibrations.text import (
    capital,
    estimate_text,
    few_digits,
    join_words,
    keep_units_together,
    milli_amount,
    probability,
    rounded,
    typeset,
)

YES_OR_NO = " (1: yes, 0: no)"  # at the end of a constant's description
REFERENCE_DIGITS = 4  # of a reference value, whose uncertainty is not known
LONG_MIN = 120  # longer durations are given in hours


def summary(discovery: Discovery[Fit]) -> str:
    """The error before and after the added effects, and the reasons to doubt them."""
    doubts = [discovery.caution, discovery.start.table.constants.get("expired")]
    return " ".join([_error(discovery), *(f"But {doubt}." for doubt in doubts if doubt)])


def _error(discovery: Discovery[Fit]) -> str:
    start, end, structure = discovery.start, discovery.end, discovery.residual_structure
    (error, floor), unit = pool_in_milli(start), milli_unit(start)
    rows = f"{start.table.n} {start.table.type.rows}"
    pattern = f" Remaining: {typeset(structure)}." if structure else ""
    if not discovery.steps:
        return (
            f"On {rows} its rms error is {milli_amount(error, unit, 2)}, {rounded(start.pooled_excess)} × the noise "
            f"floor of {milli_amount(floor, unit, 2)}.{pattern}"
        )
    text = (
        f"On {rows} the rms error falls from {milli_amount(error, unit, 2)} to {error_text(end)}; "
        f"the noise floor is {milli_amount(floor, unit, 2)}. The held-out error falls from "
        f"{rounded(start.held_out_excess)} to {rounded(discovery.steps[-1].held_out_after)} × the noise floor."
    )
    if refinements := discovery.judgement.refinements:
        text += f" {refinement_text(len(discovery.judgement.added), refinements)}"
    return text + pattern


def key_figures(discovery: Discovery[Fit]) -> list[tuple[str, str, str]]:
    """The few numbers to remember: (what, value, remark)."""
    start, floor, unit = discovery.start, pool_in_milli(discovery.start)[1], milli_unit(discovery.start)
    first = "error before" if discovery.steps else "rms error"
    figures = [(first, error_text(start), _error_text(start, start.held_out_excess))]
    if discovery.steps:
        held_out = discovery.steps[-1].held_out_after
        figures.append(
            (
                "error after",
                error_text(discovery.end),
                _error_text(discovery.end, held_out),
            )
        )
    kind = "white noise of one mean" if start.noise.known else "from the scatter: the white noise is not known"
    return [*figures, ("noise floor", milli_amount(floor, unit, 2), kind)]


def _error_text(fit: Fit, held_out: float) -> str:
    text = f"{rounded(fit.pooled_excess)} × the noise floor; held-out error {rounded(held_out)} ×"
    return keep_units_together(text)


def next_words(e: Experiment) -> str:
    """The next experiment, the effects that it separates, and the reason."""
    pairs = [f"{a} from {join_words([y for x, y in e.separates if x == a], 'or')}" for a in dict(e.separates)]
    settings = ", ".join(f"{name} = {value}" for name, value in e.settings.items())
    return f"To separate {join_words(pairs)}, run {e.procedure}{f' with {settings}' if settings else ''}: {e.why}."


def next_takes(e: Experiment) -> str:
    """Duration of an experiment and its probability of success, if known."""
    if e.duration_s is None:
        return ""
    minutes = e.duration_s / 60
    duration = f"It takes {minutes:.0f} min" if minutes < LONG_MIN else f"It takes {minutes / 60:.1f} h"
    if e.expected is None:
        return f"{duration}. Its result cannot be predicted."
    source = "its own data" if e.expected.suffices_alone else "all data together"
    return f"{duration} and separates them with a probability of {e.expected.percent}, from {source}."


MOST_EXPLAINED = 6  # candidates shown with formula and symptom, at most; the others in numbers only
SHOWS = 1e-3  # share of the noise floor from which on a part of the noise is shown
NOTICEABLE_BIRGE = 1.05
HELD_OUT_TEXT = (
    "The ratio of error and noise floor is uncertain: for a complete model it is {chance} on this data (the digits in "
    "brackets are its standard uncertainty). The held-out error is the error on {rows} not used in the fit, from "
    "cross-validation."
)
CANDIDATES = (
    "Each effect of the catalogue that this data can excite, added alone to the given model and fitted jointly with "
    "it; best first. The error of the given model is {seen} × the noise floor; its held-out error is {unseen} ×."
)
CHANCES = (
    "p-value: the probability of so large an improvement anywhere in the search if no effect is missing. If only one "
    "is missing: the probability of a significant candidate, relative to the other candidates and to no missing "
    "effect, which has the prior probability 1/2 (Schwarz criterion). Both are approximate."
)
NO_CANDIDATE = "No effect can be tested on this data: the model already holds every effect that its columns excite."
PLACES = "Places where the mean residual is not zero; largest first, at most one for each axis and quantity."
NO_PLACE = "No angle, direction, time or temperature has a mean residual beyond the noise."
ESTIMATE_TEXT = (
    "Joint least-squares estimate. The digits in brackets are the standard uncertainty of the last digits (GUM 7.2.2)."
)
BIRGE_TEXT = (
    " The residual is larger than the noise, so the uncertainties are multiplied by the Birge ratio {birge:.2f}."
)
WHITE_KNOWN = (
    "The white noise of each mean follows from the scatter of its samples and their correlation by the output filter."
)
WHITE_UNKNOWN = (
    "The data hold no scatter of samples, so the white noise of a mean is not known; the scatter from row to row is "
    "used instead."
)
SLOW = (
    " Scatter and slow noise are estimated from the residual of the final model. The uncertainties of the parameters "
    "include all slow noise that is compatible with the data, even where none is found."
)
NO_PROPOSAL = "No proposal: no effect of the catalogue explains the residual. Pattern of the residual: {structure}."
NO_EXPERIMENT = "No further experiment is needed to decide between effects of the catalogue."


def report(
    discovery: Discovery[Fit],
    comparison: Comparison[Fit],
    date: str,
    program: str,
    pictures: Iterable[Picture] | None = None,
    motion: MotionResult | None = None,
    results: Mapping[str, Any] = MappingProxyType({}),
    is_planned: bool = True,
) -> str:
    """The page as HTML text. `comparison` is that of the given model with the data; `pictures` are those of `album`.

    `motion` is the comparison with the displacement sensor, for a run of that procedure. `results` are those of a run,
    by name, each with value, std, unit, limit and verdict. `is_planned`: the next experiment was planned; else a page
    shows its plan later beside the report, which leaves it out.
    `date` and `program` (name and version) go into the provenance: the same arguments give the same page.
    """
    album_of_all = album(discovery, comparison, motion) if pictures is None else pictures
    by_name = {picture.name: picture for picture in album_of_all}
    page = Page(
        headline=typeset(discovery.judgement.headline),
        verdict=discovery.outcome.label,
        state=discovery.outcome.value,
        subject=f"Calibration report, model {comparison.fit.model.name}",
        summary=keep_units_together(summary(discovery)),
        figures=key_figures(discovery),
        sections=[*verdicts(results), *_sections(discovery, comparison, by_name, is_planned)],
        provenance=_provenance(discovery, date, program),
    )
    return html(page if motion is None else motion_page(page, motion, by_name["evaluation"]))


def _sections(
    discovery: Discovery[Fit], comparison: Comparison[Fit], pictures: Mapping[str, Picture], is_planned: bool
) -> Iterable[Section]:
    end, given_model = discovery.end, brief(comparison.fit.model.name)
    yield Section("Error by model", (pictures["waterfall"], _steps(discovery), _held_out_remark(discovery)))
    three = [pictures[name] for name in ("measurement", "residual", "failure")]
    yield Section(f"Residuals of the model {given_model}", (*_places(comparison), _errors(comparison.fit), *three))
    curves = [picture for name, picture in pictures.items() if name.startswith("effect-")]
    yield Section("Candidates", (*_candidates(discovery), *curves))
    if places := [picture for name, picture in pictures.items() if name.startswith("place-") or name == "shares"]:
        yield Section("Places of the signal chain", places)
    yield Section("The model, extended" if discovery.steps else "The model", _model(discovery))
    for section in (matrices_section(end), budget_section(end)):
        if section is not None:
            yield section
    yield Section("Noise", ((WHITE_KNOWN if end.noise.known else WHITE_UNKNOWN) + SLOW, _noise(end)))
    if is_planned:
        yield Section("Next experiment", _next(discovery))


def _steps(discovery: Discovery[Fit]) -> Table:
    start = discovery.start
    rows = [
        (
            brief(start.model.name),
            error_text(start),
            rounded(start.pooled_excess),
            rounded(start.held_out_excess),
            "as given",
        )
    ]
    for step in discovery.steps:
        curve = "unknown cause" if step.name in discovery.findings.curves else "refines the form of a cause"
        part = "cause" if step.name in discovery.causes else curve
        excess, held_out = rounded(step.after.pooled_excess), rounded(step.held_out_after)
        rows.append((f"+ {step.name}", error_text(step.after), excess, held_out, part))
    head = ("model", "rms error", "error / floor", "held-out error / floor", "part")
    return Table("Errors by model", head, rows, (1, 2, 3), headed=False)


def _held_out_remark(discovery: Discovery[Fit]) -> Remark:
    chance = estimate_text(1.0, spread_of_excess(discovery.end))
    return Remark(HELD_OUT_TEXT.format(chance=chance, rows=discovery.start.table.type.rows))


def spread_of_excess(fit: Fit) -> float:
    """Standard uncertainty that chance alone gives the pooled excess of a complete model."""
    return float(1 / np.sqrt(2 * max(fit.residual.size - len(fit.theta), 1)))


def _places(comparison: Comparison[Fit]) -> tuple[Block, ...]:
    if not comparison.fails:
        return (NO_PLACE,)
    return PLACES, Items([capital(typeset(place.text)) for place in comparison.fails])


def _errors(fit: Fit) -> Table:
    """Error and noise floor of each channel."""
    floor = "noise floor" if fit.noise.known else "scatter (noise floor not known)"
    rows = [
        (channel, _amount(fit.rmse, c, fit), _amount(fit.noise.floor, c, fit), rounded(fit.excess[c]))
        for c, channel in enumerate(fit.channels)
    ]
    head = ("axis", "rms error", floor, "error / floor")
    return Table("Errors and noise of each axis", head, rows, (1, 2, 3), headed=False)


def _noise(fit: Fit) -> Table:
    """Noise floor, scatter and slow noise of each channel."""
    rows = []
    for c, channel in enumerate(fit.channels):
        slow = _amount(fit.noise.slow, c, fit)
        floor = _amount(fit.noise.floor, c, fit) if fit.noise.known else "not known"
        time = "–" if slow == "none found" else _time_constant(fit.noise.taus_s[c])
        rows.append((channel, floor, _amount(fit.noise.scatter, c, fit), slow, time))
    head = ("axis", "noise floor", "further scatter", "slow noise, rms", "time constant of slow noise")
    return Table("Noise", head, rows, (1, 2, 3, 4), headed=False)


def _amount(values: Array, c: int, fit: Fit) -> str:
    """An error of channel `c` in mg and, of poses, in the output's unit too."""
    if not values[c] > SHOWS * fit.noise.floor[c]:
        return "none found"
    volts = f"{milli_amount(1e3 * values[c], f'm{fit.table.unit}')} = " if fit.table.type.stage_angles else ""
    return f"{volts}{milli_amount(in_milli(values, fit)[c], milli_unit(fit))}"


def _time_constant(taus_s: tuple[float, ...]) -> str:
    if len(taus_s) == 1:
        return f"{rounded(taus_s[0], 2)} s"
    return f"flicker noise, {rounded(min(taus_s), 2)} to {rounded(max(taus_s), 2)} s"


def _candidates(discovery: Discovery[Fit]) -> tuple[Block, ...]:
    candidates, start = discovery.findings.candidates, discovery.start
    if not candidates:
        return (NO_CANDIDATE,)
    rows = [
        (
            c.name,
            rounded(c.excess_after),
            rounded(c.held_out_after),
            probability(c.p_value),
            probability_text(c) or "–",
            ", ".join(c.indistinguishable_from) or "–",
        )
        for c in candidates
    ]
    explained = {
        rank: _explanation(c, start.table.unit)
        for rank, c in enumerate(candidates)
        if rank == 0 or (rank < MOST_EXPLAINED and c.p_value < SIGNIFICANT)
    }
    head = ("effect", "error / floor", "held-out error / floor", "p-value", ONLY_ONE, "inseparable from")
    text = CANDIDATES.format(seen=rounded(start.pooled_excess), unseen=rounded(start.held_out_excess))
    return text, Table("Candidates", head, rows, (1, 2, 3, 4), headed=False, details=explained), Remark(CHANCES)


def _explanation(c: Candidate, output_unit: str) -> tuple[str, ...]:
    """Summary, formula and symptom."""
    formula = Markup(formula_html(c.effect.formula, output_unit))  # noqa: S704 it escapes
    return (
        capital(c.effect.summary),
        Markup('<span class="formula">{}</span>').format(formula),
        Markup("<b>Symptom:</b> {}").format(capital(c.effect.symptom)),
    )


def _model(discovery: Discovery[Fit]) -> tuple[Block, ...]:
    end, added_effects = discovery.end, {step.name for step in discovery.steps}
    rows = [row for term in end.model.terms for row in _parameters(term, term.name in added_effects)]
    head = ("effect", "parameter", "axis", "value (standard uncertainty)", "unit")
    birge = BIRGE_TEXT.format(birge=end.birge) if end.birge > NOTICEABLE_BIRGE else ""
    name = Markup('<b class="long">{}</b>').format(end.model.name)
    table = Table("Parameters", head, rows, headed=False, grouped=True)
    return name, ESTIMATE_TEXT + birge, table, _errors(end)


def _parameters(term: Term, is_added: bool) -> Iterable[tuple[str, ...]]:
    """Rows of one effect: its parameters, its free curves, and its constants."""
    shared = "all" if term.tied else "–"
    rows = [(e.name, e.axis or shared, *estimate_cells(e, "uncertainty not known")) for e in term.quantities]
    rows += [("curve", axis or shared, f"{n} coefficients", "") for axis, n in term.coefficients.items()]
    rows += [_constant(term, name, value) for name, value in term.constants.items()]
    for number, row in enumerate(rows):
        yield "" if number else f"{term.name}{' (added)' if is_added else ''}", *row


def _constant(term: Term, name: str, value: float) -> tuple[str, str, str, str]:
    """The row of a constant; one that is 1 or 0 is an answer."""
    label = term.effect.constant_docs.get(name) or column_label(name)
    if label.endswith(YES_OR_NO):
        return typeset(label.removesuffix(YES_OR_NO)), "–", "yes" if value else "no", ""
    return typeset(label), "–", f"{few_digits(value, REFERENCE_DIGITS)} (a reference value, not fitted)", ""


def _next(discovery: Discovery[Fit]) -> tuple[Block, ...]:
    experiment = discovery.next_experiment
    if experiment is not None:
        command = (Code(experiment.command), next_takes(experiment)) if experiment.command else ()
        return next_words(experiment), *command
    if discovery.outcome.value == "unexplained":
        return (NO_PROPOSAL.format(structure=typeset(discovery.residual_structure or "none")),)
    return (NO_EXPERIMENT,)


def _provenance(discovery: Discovery[Fit], date: str, program: str) -> dict[str, str]:
    table, model = discovery.start.table, discovery.start.model
    facts: dict[str, object] = {
        "data": name_of_file(table.source),
        "kind and size": f"{table.n} {table.type.rows}; columns {', '.join(table.columns)}",
        "SHA-256 of the data": table.digest,
        "local gravity": f"{table.gravity_m_s2:g} m/s²",
        **constant_facts({name: value for name, value in table.constants.items() if name != "gravity_m_s2"}),
        **model_facts(model),
        "program": program,
        "date": date,
    }
    return {name: str(value) for name, value in facts.items()}
