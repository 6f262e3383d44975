"""The report: one HTML page that needs no network, with verdict, falling error, candidates, model, noise, provenance.

Every uncertain number has its uncertainty, or states that it is unknown. The template has the layout; this file makes
its texts and numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import PurePath, PureWindowsPath
from typing import Any

import numpy as np

from calibrations.analyses.motion import MotionResult, Quantity
from calibrations.criteria import CERTAIN_PROBABILITY, SIGNIFICANT
from calibrations.design.expected import pairs_separated
from calibrations.design.experiment import Experiment
from calibrations.discovery.results import Candidate, Comparison, Discovery, Step
from calibrations.fitting.fit import Fit
from calibrations.fitting.sensed import in_milli, milli_unit, pooled_milli
from calibrations.model import Estimate, Model, Term
from calibrations.motion.reference import Bias
from calibrations.presentation.chart import Picture
from calibrations.presentation.charts.discovery import album, error_text
from calibrations.presentation.formula import formula_html
from calibrations.presentation.report import parameters
from calibrations.presentation.report.page import figure, page
from calibrations.text import capital, estimate_text, joined, minus, probability, rounded, unbroken, unit

LONG_MIN = 120  # longer durations are given in hours


def summary(found: Discovery[Fit]) -> str:
    """The error before and after the added effects, and the reasons to doubt them."""
    doubts = [found.caution, found.start.table.constants.get("expired")]
    return " ".join([_error(found), *(f"But {doubt}." for doubt in doubts if doubt)])


def _error(found: Discovery[Fit]) -> str:
    (error, floor), unit = pooled_milli(found.start), milli_unit(found.start)
    rows = f"{found.start.table.n} {found.start.table.type.rows}"
    if not found.steps:
        left = f" Remaining: {found.residual_structure}." if found.residual_structure else ""
        return (
            f"On {rows} its rms error is {rounded(error, 2)} {unit}, {rounded(found.start.pooled_excess)} × the noise "
            f"floor of {rounded(floor, 2)} {unit}.{left}"
        )
    unseen = rounded(found.start.held_out_excess), rounded(found.steps[-1].held_out_after)
    text = (
        f"On {rows} the rms error falls from {rounded(error, 2)} {unit} to {rounded(pooled_milli(found.end)[0], 2)} "
        f"{unit}; the noise floor is {rounded(floor, 2)} {unit}. The held-out error falls from {unseen[0]} to "
        f"{unseen[1]} × the noise floor."
    )
    if found.refinements:
        text += f" For the form of these effects the model also holds {joined(found.refinements)}."
    return f"{text} Remaining: {found.residual_structure}." if found.residual_structure else text


def key_figures(found: Discovery[Fit]) -> list[tuple[str, str, str]]:
    """The few numbers to remember: (what, value, remark)."""
    start, floor, unit = found.start, pooled_milli(found.start)[1], milli_unit(found.start)
    first = "error before" if found.steps else "rms error"
    shown = [(first, f"{rounded(pooled_milli(start)[0], 2)} {unit}", _of_floor(start, start.held_out_excess))]
    if found.steps:
        held_out = found.steps[-1].held_out_after
        shown.append(
            ("error after", f"{rounded(pooled_milli(found.end)[0], 2)} {unit}", _of_floor(found.end, held_out))
        )
    kind = "white noise of one mean" if start.noise.known else "from the scatter: the white noise is not known"
    return [*shown, ("noise floor", f"{rounded(floor, 2)} {unit}", kind)]


def _of_floor(fit: Fit, held_out: float) -> str:
    return f"{rounded(fit.pooled_excess)} × the noise floor; held-out error {rounded(held_out)} ×"


def next_words(e: Experiment) -> str:
    """What to run next, which effects it separates, and why."""
    pairs = [f"{a} from {joined([y for x, y in e.separates if x == a], 'or')}" for a in dict(e.separates)]
    settings = ", ".join(f"{name} = {value}" for name, value in e.settings.items())
    return f"To separate {joined(pairs)}, run {e.procedure}{f' with {settings}' if settings else ''}: {e.why}."


def next_takes(e: Experiment) -> str:
    """Its duration and its probability of success, as far as they are known."""
    if e.duration_s is None:
        return ""
    minutes = e.duration_s / 60
    takes = f"It takes {minutes:.0f} min" if minutes < LONG_MIN else f"It takes {minutes / 60:.1f} h"
    if e.expected is None:
        return f"{takes}. Its result cannot be predicted."
    alone = e.expected.probability_alone >= CERTAIN_PROBABILITY
    percent = 100 * pairs_separated(e.expected.alone if alone else e.expected.together)
    whose = "its own data" if alone else "all data together"
    return f"{takes} and separates them with a probability of {min(percent, 99.9):.3g} %, from {whose}."


EXPLAINED = 6  # candidates shown with formula and symptom, at most; the others in numbers only
SHOWS = 1e-3  # share of the noise floor from which on a part of the noise is shown
SURE = 0.999  # more digits of a probability mean nothing


def report(
    found: Discovery[Fit],
    beside: Comparison[Fit],
    date: str,
    program: str,
    pictures: Iterable[Picture] | None = None,
    motion: MotionResult | None = None,
) -> str:
    """The page as HTML text. `beside` compares the given model with the data; `pictures` are those of `album`.

    `motion` is the comparison with the displacement sensor, for a run of that procedure.
    `date` and `program` (name and version) go into the provenance: the same arguments give the same page.
    """
    shown = {p.name: figure(p) for p in (album(found, beside, motion) if pictures is None else pictures)}
    discovery = _head(found, beside.fit.model.name)
    return page(
        "report.html",
        **(motion_head(motion) if motion else discovery),
        discovery=discovery,
        kind=found.start.table.type.rows,
        steps=[_first(found), *(_step(step, found) for step in found.steps)],
        chance_of_excess=estimate_text(1.0, spread_of_excess(found.end)),
        fails=[capital(minus(place.text)).replace("x the noise", "× the noise") for place in beside.fails],
        given=beside.fit.model.name,
        given_errors=_errors(beside.fit),
        candidates=[_candidate(c, k, found.start.table.unit) for k, c in enumerate(found.findings.candidates)],
        before=(rounded(found.start.pooled_excess), rounded(found.start.held_out_excess)),
        model=found.end.model.name,
        parameters=_parameters(found.end.model, {s.name for s in found.steps}),
        general=parameters.matrices(found.end),
        budget=parameters.budget(found.end),
        birge=f"{found.end.birge:.2f}" if found.end.birge > 1.05 else "",
        end_errors=_errors(found.end),
        known=found.end.noise.known,
        next=_next(found.next_experiment) if found.next_experiment else None,
        structure=found.residual_structure,
        provenance=_provenance(found, date, program),
        motion=motion_section(motion) if motion else None,
        pictures=shown,
        curves=[drawn for name, drawn in shown.items() if name.startswith("effect-")],
        places=[drawn for name, drawn in shown.items() if name.startswith("place-") or name == "shares"],
    )


def _next(e: Experiment) -> dict[str, str]:
    return {"words": next_words(e), "command": e.command, "takes": next_takes(e)}


def _head(found: Discovery[Fit], model: str) -> dict[str, Any]:
    """The head of the page, or of its part on models that were fitted to a motion."""
    return {
        "headline": found.judgement.headline,
        "verdict": found.outcome.label,
        "state": found.outcome.value,
        "what": f"Calibration report, model {model}",
        "summary": unbroken(summary(found)),
        "figures": key_figures(found),
    }


def spread_of_excess(fit: Fit) -> float:
    """Standard uncertainty that chance alone gives the pooled excess of a complete model."""
    return float(1 / np.sqrt(2 * max(fit.residual.size - len(fit.theta), 1)))


def _first(found: Discovery[Fit]) -> dict[str, str]:
    level = {"seen": rounded(found.start.pooled_excess), "unseen": rounded(found.start.held_out_excess)}
    return {"name": found.start.model.name, "error": error_text(found.start), "role": "as given", **level}


def _step(step: Step[Fit], found: Discovery[Fit]) -> dict[str, str]:
    level = {"seen": rounded(step.after.pooled_excess), "unseen": rounded(step.held_out_after)}
    role = "cause" if step.name in found.causes else "refines the form of a cause"
    return {"name": f"+ {step.name}", "error": error_text(step.after), "role": role, **level}


def _candidate(c: Candidate, rank: int, out: str) -> dict[str, Any]:
    return {
        "name": c.name,
        "explained": rank == 0 or (rank < EXPLAINED and c.p_value < SIGNIFICANT),
        "summary": capital(c.effect.summary),
        "formula": formula_html(c.effect.formula, out),
        "symptom": capital(c.effect.symptom),
        "seen": rounded(c.excess_after),
        "unseen": rounded(c.held_out_after),
        "p": probability(c.p_value),
        "probability": _probability(c.probability),
        "rivals": ", ".join(c.indistinguishable_from) or "–",
    }


def _probability(p: float) -> str:
    """A probability is approximate: never certain, never impossible."""
    return f"above {SURE:g}" if p > SURE else f"below {1 - SURE:g}" if p < 1 - SURE else f"{p:.2g}"


def _errors(fit: Fit) -> list[dict[str, str]]:
    """One row for each channel: error, floor, scatter and slow noise, in the residual's unit and in mg."""
    posed = fit.table.type.stage_angles
    noise = {"rmse": fit.rmse, "floor": fit.noise.floor, "scatter": fit.noise.scatter, "slow": fit.noise.slow}
    rows = []
    for c, channel in enumerate(fit.channels):
        row = {"channel": channel, "excess": rounded(fit.excess[c]), "tau": _time_constant(fit.noise.taus_s[c])}
        for name, values in noise.items():
            volts = f"{rounded(1e3 * values[c])} m{fit.table.unit} = " if posed else ""
            shows = values[c] > SHOWS * fit.noise.floor[c]
            row[name] = f"{volts}{rounded(in_milli(values, fit)[c])} {milli_unit(fit)}" if shows else "none found"
        if row["slow"] == "none found":
            row["tau"] = "–"
        rows.append(row)
    return rows


def _time_constant(taus_s: tuple[float, ...]) -> str:
    if len(taus_s) == 1:
        return f"{rounded(taus_s[0], 2)} s"
    return f"flicker noise, {rounded(min(taus_s), 2)} to {rounded(max(taus_s), 2)} s"


def _parameters(model: Model, added: set[str]) -> list[dict[str, Any]]:
    return [
        {
            "effect": term.name,
            "added": term.name in added,
            "tied": term.tied,
            "rows": [*map(_estimate, term.quantities), *_curves(term)],
            "constants": {name: rounded(value, 6) for name, value in term.constants.items()},
        }
        for term in model.terms
    ]


def _curves(term: Term) -> list[dict[str, str]]:
    """A free form: its coefficients have no meaning each."""
    return [
        {"name": "curve", "axis": axis or "–", "remark": "", "value": f"{n} coefficients", "unit": ""}
        for axis, n in term.coefficients.items()
    ]


def _estimate(e: Estimate) -> dict[str, str]:
    row = {"name": e.name, "axis": e.axis or "–", "remark": "" if e.std else "uncertainty not known"}
    if not e.identified:
        return row | {"value": f"not identified: {e.why}", "unit": "", "remark": ""}
    return row | {"value": estimate_text(e.value, e.std), "unit": unit(e.unit)}


def _provenance(found: Discovery[Fit], date: str, program: str) -> dict[str, str]:
    table, model = found.start.table, found.start.model
    facts: dict[str, object] = {
        "data": _name(table.source),
        "kind and size": f"{table.n} {table.type.rows}; columns {', '.join(table.columns)}",
        "SHA-256 of the data": table.digest,
        "local gravity": f"{table.gravity_m_s2:g} m/s²",
        **{f"constant {name}": value for name, value in table.constants.items() if name != "gravity_m_s2"},
        "model given": model.name,
        **{f"model given: {name}": value for name, value in _named(model.provenance).items()},
        "program": program,
        "date": date,
    }
    return {name: str(value) for name, value in facts.items()}


def _named(provenance: Mapping[str, str | float]) -> dict[str, str | float]:
    return {name: _name(value) if isinstance(value, str) else value for name, value in provenance.items()}


def _name(source: str) -> str:
    """The name of a file without its folder: paths of this machine are private."""
    if PurePath(source).is_absolute() or PureWindowsPath(source).is_absolute():
        return PureWindowsPath(source).name
    return source


# A run of the procedure motion


NAMES = {
    "rmse-linear-x": "rms error of the linear model",
    "rmse-physical-x": "rms error of the physical model",
    "improvement-x": "reduction of the rms error by the physical model",
    "noise-limit-x": "error by the sensor's noise alone, in this band",
    "amplitude": "peak acceleration, from the displacement sensor",
    "frequency": "frequency, from the displacement sensor",
}
LEAST = 1e-8


def motion_head(found: MotionResult) -> dict[str, Any]:
    """The head of the page."""
    linear, physical, limit = (
        f"{rounded(q.value)} mm/s²" for q in (found.rmse_linear, found.rmse_physical, found.noise_limit)
    )
    return {
        "headline": f"In motion, the physical model has an rms error of {physical}, the linear model of {linear}.",
        "verdict": "measured",
        "state": "found",
        "what": f"Calibration report, motion at {found.frequency.value:.4g} Hz",
        "summary": unbroken(_summary(found)),
        "figures": [
            ("linear model of the sweep", linear, "rms error against the displacement sensor"),
            ("physical model of the sweep", physical, f"{rounded(found.excess)} × the noise limit"),
            ("noise limit", limit, "error by the sensor's noise alone, in this band"),
        ],
    }


def motion_section(found: MotionResult) -> dict[str, Any]:
    """The rows of the section on the motion."""
    return {
        "quantities": [(NAMES[name], *_written(quantity)) for name, quantity in found.results.items()],
        "biases": [_bias(bias) for bias in found.biases],
    }


def _summary(found: MotionResult) -> str:
    before, after, limit = (rounded(q.value) for q in (found.rmse_linear, found.rmse_physical, found.noise_limit))
    return (
        f"The motion has a frequency of {found.frequency.value:.4g} Hz and a peak of "
        f"{rounded(found.amplitude.value, 4)} mm/s². The rms error of the linear model is {before} mm/s², that of the "
        f"physical model {after} mm/s², {100 * found.improvement.value:.1f} % less. The sensor's noise alone gives "
        f"{limit} mm/s² in this band: the physical model has {rounded(found.excess)} × that limit. Both models were "
        "fitted to the sweep of this run, without the motion. Models that are fitted to the motion itself have a "
        "smaller error, given below, because that fit includes the changes since the sweep."
    )


def _written(q: Quantity) -> tuple[str, str]:
    if q.unit == "1":
        return estimate_text(100 * q.value, 100 * q.std), "%"
    return estimate_text(q.value, q.std), unit(q.unit)


def _bias(bias: Bias) -> dict[str, str]:
    low, high = bias.band_hz
    return {
        "name": bias.name,
        "at": f"{bias.at_hz:.4g} Hz",
        "amplitude": f"{_small(100 * bias.amplitude)} %",
        "phase": f"{_small(float(np.degrees(bias.phase_rad)))}°",
        "band": f"{low:.4g} to {high:.4g} Hz",
        "edge": f"{bias.edge_s:.2g} s",
    }


def _small(value: float) -> str:
    """Two digits; 0 for values within the rounding of the computation."""
    return rounded(value, 2) if abs(value) > LEAST else "0"
