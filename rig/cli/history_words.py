"""What `rig history` says of a sensor's life, in words and as JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from calibrations.evaluations.agreement import Agreement
from calibrations.evaluations.stability import YEAR_DAYS
from calibrations.model import Estimate
from rig.analysis.history import Calibration, History, Quantity
from rig.cli.output import columns, note
from rig.cli.words import with_uncertainty

Compared = list[tuple[str, str, dict[str, tuple[str, Agreement]]]]  # one, other, and what they come to
NO_LIMIT = "When the next calibration is due needs a limit: --limit bias-x=0.005, or limits.results of the bench file."


def lines(found: History) -> Iterator[str]:
    of = found.calibrations
    yield f"{found.sensor}: {len(of)} calibrations from {of[0].day} to {of[-1].day}, by the model {found.model}"
    yield ""
    head = ("date", "data", "rig", *(q.name for q in found.quantities))
    yield columns(head, [_row(each, found.quantities) for each in of])
    yield ""
    yield columns(("quantity", "drift a year", "scatter", "chart", "allowed", "due"), map(_stability, found.quantities))
    yield ""
    yield _next(found)
    yield from (f"{each.data}: {each.expired}." for each in of if each.expired)
    for data, why in found.passed_over.items():
        note(f"Passed over: {data}: {why}")


def _row(each: Calibration, quantities: Sequence[Quantity]) -> tuple[str, ...]:
    values = (each.values.get(q.name) for q in quantities)
    shown = ("-" if v is None else with_uncertainty(Estimate("", "", v.value, v.std, v.unit)) for v in values)
    return each.day, each.data, each.rig, *shown


def _stability(q: Quantity) -> tuple[str, ...]:
    line, verdict = q.line, "-" if q.chart is None else q.chart.verdict
    if line is None:
        return q.name, "-", "-", verdict, _allowed(q), "-"
    slope = Estimate("", "", YEAR_DAYS * line.slope, YEAR_DAYS * line.slope_std, q.unit)
    drift = f"{with_uncertainty(slope)}{'' if line.drifts else ', not significant'}"
    return q.name, drift, f"{line.scatter:.2g} {q.unit}", verdict, _allowed(q), str(q.due or "-")


def _allowed(q: Quantity) -> str:
    return "-" if q.allowed is None else f"{q.allowed[0]:.6g} .. {q.allowed[1]:.6g}"


def _next(found: History) -> str:
    if found.due is not None:
        names = ", ".join(q.name for q in found.quantities if q.due == found.due)
        return f"Next calibration due on {found.due}: {names} may then be beyond what is allowed."
    if all(q.allowed is None for q in found.quantities):
        return NO_LIMIT
    if all(q.line is None for q in found.quantities):
        return "When the next calibration is due shows from three calibrations on, at different times."
    return "No calibration is due within ten years by the drift that these show."


def near_lines(near: tuple[Calibration, float] | None, on: Any, why: str | None) -> Iterator[str]:
    if near is None:
        return
    calibration, age_days = near
    side = "before" if age_days >= 0 else "after"
    yield f"Closest to {on.date()}: {calibration.data}, {calibration.day}, {abs(age_days):.0f} days {side}."
    if why is not None:
        yield f"But it is stale: {why}."


def compared_lines(compared: Compared) -> Iterator[str]:
    for one, other, rows in compared:
        yield f"\n{one} beside {other}"
        yield columns(
            ("quantity", one, other, "difference", "U", "unit", "E_n", ""),
            [
                (name, f"{each.a:.7g}", f"{each.b:.7g}", f"{each.difference:.2g}", f"{each.expanded:.2g}", unit,
                 f"{each.e_n:.2f}", "agree" if each.agrees else "do not agree")
                for name, (unit, each) in rows.items()
            ],
        )  # fmt: skip


def document(
    found: History, near: tuple[Calibration, float] | None, why: str | None, compared: Compared
) -> dict[str, Any]:
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
        "closest": None if near is None else {"data": near[0].data, "age_days": near[1], "stale": why},
        "compared": [
            {"one": one, "other": other, "quantities": _agreements(rows)} for one, other, rows in compared
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
