"""The report on a soak: one HTML page with course, steady state, gaps and verdicts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from calibrations.analyses.forecast import ForecastHistory, steady_time
from calibrations.analyses.soak import HOUR_S, QuantityHistory, RecordGap, Soak
from calibrations.presentation.chart import Picture
from calibrations.presentation.charts.soak import soak_album
from calibrations.presentation.document import Items, Page, Remark, Section, Table
from calibrations.presentation.page import html
from calibrations.presentation.report.parameters import verdicts
from calibrations.text import estimate_text, in_milli, join_words, minus, positive_text, rounded

LARGEST_WANDER_K = 1.0  # peak to peak; ambient that changes by more is not constant
TOLERANCE = (
    "The digits in brackets are the standard uncertainty of the last digits, slow noise included. The tolerance is "
    "the expanded uncertainty (k = 2) of one reversal. A quantity is steady from the time after which it stays "
    "within the tolerance."
)
FORECAST = (
    "Forecasts of the final value by the Kalman filters at the end of the soak, with 95 % bounds and without slow "
    "noise, and the time from which they were known."
)
NO_GAP = "None: the record holds every sample between the first and the last reversal, except during moves."


def soak_report(
    soak: Soak,
    results: Mapping[str, Any],
    facts: Mapping[str, str],
    pictures: Iterable[Picture] | None = None,
    forecasts: Mapping[str, ForecastHistory] = MappingProxyType({}),
) -> str:
    """The page as HTML text. `results` are the run's, by name, each with value, std, unit, limit and verdict; `facts`
    its provenance; `forecasts` the forecasts of each quantity. The same arguments give the same page.
    """
    drawn_pictures = soak_album(soak, forecasts) if pictures is None else pictures
    steady = soak.time_s() is not None
    return html(
        Page(
            headline=_headline(soak, forecasts),
            verdict="steady" if steady else "not steady",
            state="adequate" if steady else "ambiguous",
            subject=f"Soak, {facts['sensor']}",
            summary=_summary(soak),
            figures=_figures(soak),
            sections=[
                Section("Course", list(drawn_pictures)),
                _courses(soak),
                *_forecasts(forecasts, soak.table.unit),
                *verdicts(results),
                _gaps(soak),
            ],
            provenance=facts,
        )
    )


def _courses(soak: Soak) -> Section:
    head = (
        "quantity", "axis", "final value", "drift, first to last", "tolerance", "unit", "time constants (h)",
        "steady after (h)",
    )  # fmt: skip
    rows = [_course(course, soak.table.unit) for course in soak.courses.values()]
    table = Table("Bias and scale factor", head, rows, (2, 3, 4, 6, 7), headed=False)
    return Section("Results", (table, Remark(TOLERANCE)))


def _forecasts(forecasts: Mapping[str, ForecastHistory], unit: str) -> Iterable[Section]:
    if forecasts:
        head = ("quantity", "axis", "final value", "unit", "known after (h)")
        rows = [_outlook(name, history, unit) for name, history in forecasts.items()]
        yield Section("Forecasts", (Table("Forecasts", head, rows, (2, 4), headed=False), Remark(FORECAST)))


def _gaps(soak: Soak) -> Section:
    if not soak.gaps:
        return Section("Gaps", (NO_GAP,))
    return Section("Gaps", ("Times without samples; shaded in the pictures.", Items(list(map(_gap, soak.gaps)))))


def _headline(soak: Soak, forecasts: Mapping[str, ForecastHistory]) -> str:
    time = soak.time_s()
    if time is not None and soak.from_start():
        return (
            f"Bias and scale factor are steady since the first reversal, {rounded(time[0] / HOUR_S)} h after power-on."
        )
    if time is not None:
        return f"Bias and scale factor are steady {_hours(time)} h after power-on."
    if any(course.state is None for course in soak.courses.values()):
        return "Too few reversals to decide whether bias and scale factor are steady."
    waiting = [
        f"{_spelt(course.quantity)} of {course.axis}" for course in soak.courses.values() if course.time_s is None
    ]
    text = f"No steady state within {_span_h(soak)} h: {join_words(waiting)} may still drift."
    bounds = steady_time(forecasts)
    if bounds is None:
        return text
    low, value, high = (rounded(time_s / HOUR_S, 2) for time_s in bounds)
    if np.isfinite(bounds.high):
        interval_words = f", {low} to {high} h (95 %)" if low != high else ""
        return f"{text} Forecast: {value} h after power-on{interval_words}."
    return f"{text} Forecast: later than {low} h after power-on."


def _summary(soak: Soak) -> str:
    """The amount of data, and possible disturbances."""
    held_h = float(np.sum(soak.holds.column("n"))) / soak.table.number("sample_rate_hz", 1.0) / HOUR_S
    count = len(next(iter(soak.courses.values())).t_s)
    reversals = f"{count} reversal{'s' * (count > 1)}"
    if held_h:
        text = f"The record holds every sample of {rounded(held_h)} h at rest, and {reversals}."
    else:
        text = f"The soak ended before the record at rest began. The record holds {reversals}."
    wander_k = soak.temperature_wander_k
    if wander_k is not None and wander_k > LARGEST_WANDER_K:
        text += (
            f" Besides the sensor's own warming, the temperature changed by {rounded(wander_k, 2)} K. The ambient "
            "temperature was not constant and caused a part of the drift."
        )
    if soak.left_out:
        text += f" {soak.left_out} reversals are not used: they were interrupted, or the oven was not warm."
    if soak.gaps:
        lost_time, plural = _length(sum(gap.length_s for gap in soak.gaps)), "s" if len(soak.gaps) > 1 else ""
        text += (
            f" {lost_time} are lost in {len(soak.gaps)} gap{plural}. The fit assumes that the sensor stayed powered."
        )
    return text


def _figures(soak: Soak) -> list[tuple[str, str, str]]:
    """The few numbers to remember: (what, value, remark)."""
    figures = []
    for axis in soak.axes:
        time, bias = soak.time_s(axis), soak.courses[f"bias-{axis}"]
        if bias.state is not None:
            factor, unit = in_milli(soak.table.unit)
            change = f"{_signed_text(factor * bias.state.drift[0])} {unit}"
            drift = f"bias drifts by {change}" if bias.state.terms else "no drift of the bias beyond the noise"
            reached = "from the start" if soak.from_start(axis) else f"{_hours(time)} h" if time else "not reached"
            figures.append((f"steady state, axis {axis}", reached, drift))
    wander_k = soak.temperature_wander_k
    if wander_k is not None:
        low, high = (float(f(soak.holds.column("temperature_c"))) for f in (np.min, np.max))
        remark = f"{low:.1f} to {high:.1f} °C; ambient changed by {rounded(wander_k, 2)} K"
        figures.append(("temperature at the end", f"{soak.holds.column('temperature_c')[-1]:.1f} °C", remark))
    return figures


def _course(course: QuantityHistory, output_unit: str) -> tuple[str, ...]:
    """One row of the table; `output_unit` is the unit of the outputs: a bias in mV, a scale factor in mV/g."""
    state, (factor, unit) = course.state, in_milli(output_unit if course.quantity == "bias" else f"{output_unit}/g")
    name = _spelt(course.quantity)
    if state is None:
        return name, course.axis, rounded(factor * course.values[-1], 6), "–", "–", unit, "–", "–"
    taus = [estimate_text(*(value / HOUR_S for value in term.tau_s)) for term in state.terms]
    return (
        name,
        course.axis,
        estimate_text(*(factor * value for value in state.final)),
        estimate_text(*(factor * value for value in state.drift)) if state.terms else "none beyond the noise",
        rounded(factor * state.tolerance, 2),
        unit,
        join_words(taus) if taus else "–",
        "first reversal" if state.from_start else _hours(course.time_s) if course.time_s else "not reached",
    )


def _spelt(quantity: str) -> str:
    return quantity.replace("scale", "scale factor")


def _outlook(name: str, history: ForecastHistory, output_unit: str) -> tuple[str, ...]:
    """One row of the forecasts: the last forecast with its 95 % bounds, and when it became known."""
    quantity, _, axis = name.partition("-")
    final, known_s = history.last.final, history.known_s
    factor, unit = in_milli(output_unit if quantity == "bias" else f"{output_unit}/g")
    if known_s is not None:
        value = f"{rounded(factor * final.value, 7)} ± {rounded(factor * final.half, 2)}"
    elif history.last.contradicted:
        value = "not a warm-up: no forecast"
    else:
        value = f"not known: {rounded(factor * final.low, 6)} to {rounded(factor * final.high, 6)}"
    known_after = "–" if known_s is None else rounded(known_s / HOUR_S)
    return _spelt(quantity), axis, value, unit, known_after


def _gap(gap: RecordGap) -> str:
    place = gap.path or "between two poses"
    left_out = "; this reversal is not used" if gap.path.startswith("reversal") else ""
    return f"{_length(gap.length_s)} at {rounded(gap.start_s / HOUR_S, 4)} h, {place}{left_out}"


def _hours(time: tuple[float, float] | None) -> str:
    if time is None:
        return "–"
    return positive_text(*(value / HOUR_S for value in time))


def _span_h(soak: Soak) -> str:
    return rounded(max(float(course.t_s[-1]) for course in soak.courses.values()) / HOUR_S)


def _length(seconds: float) -> str:
    for unit_s, name in ((HOUR_S, "h"), (60.0, "min")):
        if seconds >= unit_s:
            return f"{rounded(seconds / unit_s)} {name}"
    return f"{rounded(seconds)} s"


def _signed_text(value: float) -> str:
    return minus(f"{value:+.2f}")
