"""What `rig history` prints of a sensor's life, as tables and as JSON; its sentences are also those of the page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import date
from typing import Any

from calibrations.analyses.stability import YEAR_DAYS, Agreement
from calibrations.presentation.text import columns, concise
from rig.cli.terminal.output import note
from rig.services.history import Calibration, History, Quantity
from rig.services.history_compared import Compared
from rig.services.history_words import agreements, but_stale, chart_verdict, near, next_due, significance, summary

Near = tuple[Calibration, float] | None  # the calibration closest to a day, and how many days older it is


def lines(found: History) -> Iterator[str]:
    of = found.calibrations
    yield summary(found)
    yield ""
    head = ("date", "data", "rig", *(q.name for q in found.quantities))
    yield columns(head, [_row(each, found.quantities) for each in of])
    yield ""
    yield columns(("quantity", "drift a year", "scatter", "chart", "allowed", "due"), map(_stability, found.quantities))
    yield ""
    yield next_due(found, "--limit bias-x=0.005")
    yield from (f"{each.data}: {each.expired}." for each in of if each.expired)
    for data, why in found.passed_over.items():
        note(f"Passed over: {data}: {why}")


def _row(each: Calibration, quantities: Sequence[Quantity]) -> tuple[str, ...]:
    values = (each.values.get(q.name) for q in quantities)
    shown = ("-" if v is None else concise(v.value, v.std, v.unit) for v in values)
    return each.day, each.data, each.rig, *shown


def _stability(q: Quantity) -> tuple[str, ...]:
    line, verdict = q.line, chart_verdict(q) or "-"
    if line is None:
        return q.name, "-", "-", verdict, _allowed(q), "-"
    drift = f"{concise(YEAR_DAYS * line.slope, YEAR_DAYS * line.slope_std, q.unit)}{significance(line)}"
    return q.name, drift, f"{line.scatter:.2g} {q.unit}", verdict, _allowed(q), str(q.due or "-")


def _allowed(q: Quantity) -> str:
    return "-" if q.allowed is None else f"{q.allowed[0]:.6g} .. {q.allowed[1]:.6g}"


def near_lines(closest: Near, on: date | None, why: str | None) -> Iterator[str]:
    if closest is not None and on is not None:
        yield near(*closest, on)
    if why is not None:
        yield but_stale(why)


def compared_lines(compared: Sequence[Compared]) -> Iterator[str]:
    for each in compared:
        yield f"\n{each.one} beside {each.other}"
        yield columns(*agreements(each, lambda value, digits: f"{value:.{digits}g}"))


def document(found: History, closest: Near, why: str | None, compared: Sequence[Compared]) -> dict[str, Any]:
    return {
        "schema": "rig.history/1",
        "sensor": found.sensor,
        "model": found.model,
        "due": str(found.due) if found.due else None,
        "calibrations": [
            {"data": c.data, "at": c.at.isoformat(), "rig": c.rig, "expired": c.expired,
             "values": {name: vars(v) for name, v in c.values.items()}}
            for c in found.calibrations
        ],
        "quantities": [_of_quantity(q) for q in found.quantities],
        "passed_over": dict(found.passed_over),
        "closest": None if closest is None else {"data": closest[0].data, "age_days": closest[1], "stale": why},
        "compared": [
            {"one": each.one, "other": each.other, "quantities": _agreements(each.rows)} for each in compared
        ],
    }  # fmt: skip


def _of_quantity(q: Quantity) -> dict[str, Any]:
    line = q.line
    return {
        "name": q.name,
        "unit": q.unit,
        "drift_per_year": None if line is None else YEAR_DAYS * line.slope,
        "drift_per_year_std": None if line is None else YEAR_DAYS * line.slope_std,
        "scatter": None if line is None else line.scatter,
        "chart": None if q.chart is None else q.chart.verdict,
        "allowed": None if q.allowed is None else list(q.allowed),
        "due": str(q.due) if q.due else None,
    }


def _agreements(rows: Mapping[str, tuple[str, Agreement]]) -> dict[str, Any]:
    return {
        name: {"difference": a.difference, "expanded": a.expanded, "e_n": a.e_n, "unit": unit, "agrees": a.agrees}
        for name, (unit, a) in rows.items()
    }
