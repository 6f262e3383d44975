"""The report on a soak: one HTML page with course, steady state, gaps and verdicts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from calibrations.analyses.forecast import ForecastHistory, steady_time
from calibrations.analyses.soak import HOUR_S, Course, RecordGap, Soak
from calibrations.presentation.chart import Picture
from calibrations.presentation.charts.soak import soak_album
from calibrations.presentation.report.page import figure, page
from calibrations.text import bound, estimate_text, in_milli, joined, minus, rounded, time_text

WANDERED_K = 1.0  # peak to peak; ambient that changes by more is not constant


def soak_report(
    found: Soak,
    results: Mapping[str, Any],
    facts: Mapping[str, str],
    pictures: Iterable[Picture] | None = None,
    foreseen: Mapping[str, ForecastHistory] = MappingProxyType({}),
) -> str:
    """The page as HTML text. `results` are the run's, by name, each with value, std, unit, limit and verdict; `facts`
    its provenance; `foreseen` the forecasts of each quantity. The same arguments give the same page.
    """
    shown = soak_album(found, foreseen) if pictures is None else pictures
    steady = found.time_s() is not None
    return page(
        "soak.html",
        headline=_headline(found, foreseen),
        verdict="steady" if steady else "not steady",
        state="adequate" if steady else "ambiguous",
        what=f"Soak, {facts['sensor']}",
        summary=_summary(found),
        figures=_figures(found),
        pictures=[figure(picture) for picture in shown],
        courses=[_course(course, found.table.unit) for course in found.courses.values()],
        foreseen=[_outlook(name, course, found.table.unit) for name, course in foreseen.items()],
        verdicts=[_verdict(name, result) for name, result in results.items() if result["limit"] is not None],
        gaps=[_gap(gap) for gap in found.gaps],
        provenance=facts,
    )


def _headline(found: Soak, foreseen: Mapping[str, ForecastHistory]) -> str:
    time = found.time_s()
    if time is not None and found.from_start():
        return (
            f"Bias and scale factor are steady since the first reversal, {rounded(time[0] / HOUR_S)} h after power-on."
        )
    if time is not None:
        return f"Bias and scale factor are steady {_hours(time)} h after power-on."
    if any(course.state is None for course in found.courses.values()):
        return "Too few reversals to decide whether bias and scale factor are steady."
    waiting = [name.replace("-", " of ") for name, course in found.courses.items() if course.time_s is None]
    shown = f"No steady state within {_span_h(found)} h: {joined(waiting)} may still drift."
    bounds = steady_time(foreseen)
    if bounds is None:
        return shown
    low, value, high = (rounded(each / HOUR_S, 2) for each in bounds)
    if np.isfinite(bounds.high):
        return f"{shown} Forecast: {value} h after power-on, {low} to {high} h (95 %)."
    return f"{shown} Forecast: later than {low} h after power-on."


def _summary(found: Soak) -> str:
    """How much was measured, and what may have disturbed it."""
    held_h = float(np.sum(found.holds.column("n"))) / found.table.number("sample_rate_hz", 1.0) / HOUR_S
    reversals = len(next(iter(found.courses.values())).t_s)
    text = f"The record holds every sample of {rounded(held_h)} h at rest, and {reversals} reversals."
    wander_k = found.temperature_wander_k
    if wander_k is not None and wander_k > WANDERED_K:
        text += (
            f" Besides the sensor's own warming, the temperature changed by {rounded(wander_k, 2)} K. The ambient "
            "temperature was not constant and caused a part of the drift."
        )
    if found.left_out:
        text += f" {found.left_out} reversals are not used: they were interrupted, or the oven was not warm."
    if found.gaps:
        lost, plural = _length(sum(gap.length_s for gap in found.gaps)), "s" if len(found.gaps) > 1 else ""
        text += f" {lost} are lost in {len(found.gaps)} gap{plural}. The fit assumes that the sensor stayed powered."
    return text


def _figures(found: Soak) -> list[tuple[str, str, str]]:
    """The few numbers to remember: (what, value, remark)."""
    shown = []
    for axis in found.axes:
        time, bias = found.time_s(axis), found.courses[f"bias-{axis}"]
        if bias.state is not None:
            factor, unit = in_milli(found.table.unit)
            change = f"{_signed(factor * bias.state.drift[0])} {unit}"
            drift = f"bias drifts by {change}" if bias.state.terms else "no drift of the bias beyond the noise"
            reached = "from the start" if found.from_start(axis) else f"{_hours(time)} h" if time else "not reached"
            shown.append((f"steady state, axis {axis}", reached, drift))
    wander_k = found.temperature_wander_k
    if wander_k is not None:
        low, high = (float(f(found.holds.column("temperature_c"))) for f in (np.min, np.max))
        remark = f"{low:.1f} to {high:.1f} °C; ambient changed by {rounded(wander_k, 2)} K"
        shown.append(("temperature at the end", f"{found.holds.column('temperature_c')[-1]:.1f} °C", remark))
    return shown


def _course(course: Course, of: str) -> dict[str, Any]:
    """One row of the table; `of` is the unit of the outputs: a bias in mV, a scale factor in mV/g."""
    state, (factor, unit) = course.state, in_milli(of if course.quantity == "bias" else f"{of}/g")
    row = {"name": course.quantity.replace("scale", "scale factor"), "axis": course.axis, "unit": unit}
    if state is None:
        return row | {
            "final": rounded(factor * course.values[-1], 6),
            "drift": "–",
            "tolerance": "–",
            "tau": "–",
            "time": "–",
        }
    taus = [estimate_text(*(each / HOUR_S for each in term.tau_s)) for term in state.terms]
    return row | {
        "final": estimate_text(*(factor * each for each in state.final)),
        "drift": estimate_text(*(factor * each for each in state.drift)) if state.terms else "none beyond the noise",
        "tolerance": rounded(factor * state.tolerance, 2),
        "tau": joined(taus) if taus else "–",
        "time": "first reversal" if state.from_start else _hours(course.time_s) if course.time_s else "not reached",
    }


def _outlook(name: str, course: ForecastHistory, of: str) -> dict[str, str]:
    """One row of the forecasts: the last forecast with its 95 % bounds, and when it became known."""
    quantity, _, axis = name.partition("-")
    final, known_s = course.last.final, course.known_s
    factor, unit = in_milli(of if quantity == "bias" else f"{of}/g")
    bounds = f"not known: {rounded(factor * final.low, 6)} to {rounded(factor * final.high, 6)}"
    return {
        "name": quantity.replace("scale", "scale factor"),
        "axis": axis,
        "unit": unit,
        "final": f"{rounded(factor * final.value, 7)} ± {rounded(factor * final.half, 2)}"
        if known_s is not None
        else ("not a warm-up: no forecast" if course.last.surprised else bounds),
        "known": "–" if known_s is None else rounded(known_s / HOUR_S),
    }


def _verdict(name: str, result: Mapping[str, Any]) -> dict[str, str]:
    value, std = result["value"], result["std"]
    shown = estimate_text(value, std) if std else minus(f"{value:.3g}")
    limit = bound(value, result["limit"])
    return {"name": name, "value": f"{shown} {result['unit']}", "limit": limit, "verdict": result["verdict"]}


def _gap(gap: RecordGap) -> dict[str, str]:
    where = gap.path or "between two poses"
    left_out = "; this reversal is not used" if gap.path.startswith("reversal") else ""
    return {"at": f"{rounded(gap.start_s / HOUR_S, 4)} h", "length": _length(gap.length_s), "where": where + left_out}


def _hours(time: tuple[float, float] | None) -> str:
    if time is None:
        return "–"
    return time_text(*(each / HOUR_S for each in time))


def _span_h(found: Soak) -> str:
    return rounded(max(float(course.t_s[-1]) for course in found.courses.values()) / HOUR_S)


def _length(seconds: float) -> str:
    for unit_s, name in ((HOUR_S, "h"), (60.0, "min")):
        if seconds >= unit_s:
            return f"{rounded(seconds / unit_s)} {name}"
    return f"{rounded(seconds)} s"


def _signed(value: float) -> str:
    return minus(f"{value:+.2f}")
