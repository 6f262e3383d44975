"""The report: one HTML page that needs no network, with verdict, falling error, candidates, model, noise, provenance.

Every number that is uncertain says how uncertain it is, or that this is not known. The page is a template; here its
words and numbers are made.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import PurePath, PureWindowsPath
from typing import Any

import numpy as np

from calibrations.compare import Comparison
from calibrations.discover import Added, Discovery
from calibrations.experiment import Experiment
from calibrations.fit import Fit
from calibrations.model import Estimate, Model
from calibrations.motion.evaluate import MotionResult
from calibrations.numerals import chance, measured, minus, plain, unit
from calibrations.pictures.album import Picture, album
from calibrations.reports import budget, general
from calibrations.reports.motion import head, section
from calibrations.reports.page import figure, page
from calibrations.reports.words import (
    VERDICTS,
    capital,
    headline,
    key_figures,
    next_takes,
    next_words,
    state,
    summary,
    unbroken,
)
from calibrations.search.candidates import SIGNIFICANT, Candidate
from calibrations.search.held_out import held_out_excess
from calibrations.units import mg, milli, pooled_mg, rows_of

EXPLAINED = 6  # candidates shown with formula and symptom, at most; the others in numbers only
SHOWS = 1e-3  # share of the noise floor from which on a part of the noise is told
SURE = 0.999  # probabilities beyond, on either side, are not told to more digits


def report(
    found: Discovery,
    beside: Comparison,
    date: str,
    program: str,
    pictures: Iterable[Picture] | None = None,
    motion: MotionResult | None = None,
) -> str:
    """The page as HTML text. `beside` sets the model that was given beside the data; `pictures` are those of `album`.

    `motion` is what a run of that procedure found beside the displacement sensor.
    `date` and `program` (name and version) stand in the provenance: the same arguments give the same page.
    """
    shown = {p.name: figure(p) for p in (album(found, beside, motion) if pictures is None else pictures)}
    discovery = _head(found, beside.fit.model.name)
    return page(
        "report.html",
        **(head(motion) if motion else discovery),
        discovery=discovery,
        kind=rows_of(found.start.table),
        steps=[_first(found), *(_step(step, found) for step in found.steps)],
        chance_of_excess=unbroken(f"1 ± {spread_of_excess(found.end)}"),
        fails=[capital(minus(place.text)).replace("x the noise", "× the noise") for place in beside.fails],
        given=beside.fit.model.name,
        given_errors=_errors(beside.fit),
        candidates=[_candidate(c, k, found.start.table.unit) for k, c in enumerate(found.path.first)],
        before=(plain(found.start.pooled_excess), plain(held_out_excess(found.start))),
        model=found.end.model.name,
        parameters=_parameters(found.end.model, {s.name for s in found.steps}),
        general=general.section(found.end),
        budget=budget.section(found.end),
        birge=f"{found.end.birge:.2f}" if found.end.birge > 1.05 else "",
        end_errors=_errors(found.end),
        known=found.end.noise.known,
        next=_next(found.next_experiment) if found.next_experiment else None,
        structure=found.residual_structure,
        provenance=_provenance(found, date, program),
        motion=section(motion) if motion else None,
        pictures=shown,
        curves=[drawn for name, drawn in shown.items() if name.startswith("effect-")],
    )


def _next(e: Experiment) -> dict[str, str]:
    return {"words": next_words(e), "command": e.command, "takes": next_takes(e)}


def _head(found: Discovery, model: str) -> dict[str, Any]:
    """The head of the page, or of its part on models that were fitted to a motion."""
    return {
        "headline": headline(found),
        "verdict": VERDICTS[state(found)],
        "state": state(found),
        "what": f"Calibration report, model {model}",
        "summary": unbroken(summary(found)),
        "figures": key_figures(found),
    }


def spread_of_excess(fit: Fit) -> str:
    """Standard uncertainty that chance alone gives the pooled excess of a complete model."""
    return plain(1 / np.sqrt(2 * max(fit.residual.size - len(fit.theta), 1)), 2)


def _error_of(fit: Fit) -> str:
    """The rms error with its unit."""
    return f"{plain(pooled_mg(fit)[0], 2)} {milli(fit)}"


def _first(found: Discovery) -> dict[str, str]:
    level = {"seen": plain(found.start.pooled_excess), "unseen": plain(held_out_excess(found.start))}
    return {"name": found.start.model.name, "error": _error_of(found.start), "role": "as given", **level}


def _step(step: Added, found: Discovery) -> dict[str, str]:
    level = {"seen": plain(step.after.pooled_excess), "unseen": plain(step.held_out_after)}
    role = "cause" if step.name in found.causes else "refines the form of a cause"
    return {"name": f"+ {step.name}", "error": _error_of(step.after), "role": role, **level}


def _candidate(c: Candidate, rank: int, out: str) -> dict[str, Any]:
    return {
        "name": c.name,
        "explained": rank == 0 or (rank < EXPLAINED and c.p_value < SIGNIFICANT),
        "summary": capital(c.effect.summary),
        "formula": c.effect.formula.replace("{out}", out),
        "symptom": capital(c.effect.symptom),
        "seen": plain(c.excess_after),
        "unseen": plain(c.held_out_after),
        "p": chance(c.p_value),
        "probability": _probability(c.probability),
        "rivals": ", ".join(c.indistinguishable_from) or "–",
    }


def _probability(p: float) -> str:
    """Only approximate: neither certain nor impossible."""
    return f"above {SURE:g}" if p > SURE else f"below {1 - SURE:g}" if p < 1 - SURE else f"{p:.2g}"


def _errors(fit: Fit) -> list[dict[str, str]]:
    """One row for each channel: error, floor, scatter and slow noise, in the residual's unit and in mg."""
    posed = fit.table.kind == "poses"
    noise = {"rmse": fit.rmse, "floor": fit.noise.floor, "scatter": fit.noise.scatter, "slow": fit.noise.slow}
    rows = []
    for c, channel in enumerate(fit.channels):
        row = {"channel": channel, "excess": plain(fit.excess[c]), "tau": _time_constant(fit.noise.taus_s[c])}
        for name, values in noise.items():
            volts = f"{plain(1e3 * values[c])} m{fit.table.unit} = " if posed else ""
            shows = values[c] > SHOWS * fit.noise.floor[c]
            row[name] = f"{volts}{plain(mg(values, fit)[c])} {milli(fit)}" if shows else "none found"
        if row["slow"] == "none found":
            row["tau"] = "–"
        rows.append(row)
    return rows


def _time_constant(taus_s: tuple[float, ...]) -> str:
    if len(taus_s) == 1:
        return f"{plain(taus_s[0], 2)} s"
    return f"flicker noise, {plain(min(taus_s), 2)} to {plain(max(taus_s), 2)} s"


def _parameters(model: Model, added: set[str]) -> list[dict[str, Any]]:
    return [
        {
            "effect": term.name,
            "added": term.name in added,
            "tied": term.tied,
            "rows": [_estimate(e) for e in term.estimates],
            "constants": {name: plain(value, 6) for name, value in term.constants.items()},
        }
        for term in model.terms
    ]


def _estimate(e: Estimate) -> dict[str, str]:
    row = {"name": e.name, "axis": e.axis or "–", "remark": "" if e.std else "uncertainty not known"}
    if not e.identified:
        return row | {"value": f"not identified: {e.why}", "unit": "", "remark": ""}
    return row | {"value": measured(e.value, e.std), "unit": unit(e.unit)}


def _provenance(found: Discovery, date: str, program: str) -> dict[str, str]:
    table, model = found.start.table, found.start.model
    facts: dict[str, object] = {
        "data": _name(table.source),
        "kind and size": f"{table.n} {rows_of(table)}; columns {', '.join(table.columns)}",
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
    """A file by its name alone: where it lies on this machine is nobody else's business."""
    if PurePath(source).is_absolute() or PureWindowsPath(source).is_absolute():
        return PureWindowsPath(source).name
    return source
