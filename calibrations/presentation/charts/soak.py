"""Pictures of a soak: bias and scale factor over the hours, the surroundings, and the noise of the still record."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType

import numpy as np

from calibrations.analyses.forecast import ForecastHistory
from calibrations.analyses.soak import HOUR_S, QuantityHistory, Soak
from calibrations.presentation.chart import (
    AMBER,
    BAND,
    BLUE,
    GREEN,
    INK,
    QUIET,
    VERMILION,
    Axis,
    Band,
    Chart,
    Line,
    Note,
    Panel,
    Picture,
    Points,
    Rule,
    Series,
    Span,
    single_chart,
    stack_panels,
)
from calibrations.table import Array
from calibrations.text import add_prefix, in_milli, positive_text, rounded

COLOURS = {"x": BLUE, "y": VERMILION}
TIME = "time since power-on (h)"
SHOWN = 600  # means of the still record that a line is drawn through, at most
CURVE = 400  # points of a fitted curve
WINDOW = 1.6  # times the whole drift: height of the chart; the bounds are far wider in the beginning
DOTS = "Dots are reversals, with their standard errors"
APPROACH = (
    "; the line is the exponential approach with its standard error. The grey band is the expanded uncertainty of one "
    "reversal about the final value: within it no measurement can separate the remaining drift from noise. The broken "
    "line is the time from which the drift stays within it"
)
STILL = " The thin grey line is the record of the level sensor between reversals, shifted onto the bias."
FORECAST_LEGEND = (
    "Final values of bias and scale factor by the Kalman filters' forecasts at each time: a line within its 95 % "
    "bounds, less the last forecast. The dotted line is the drift at that time. The broken line is the time from which "
    "the final value was known: from then on the bounds are narrow compared with the whole drift."
)


def soak_album(soak: Soak, histories: Mapping[str, ForecastHistory] = MappingProxyType({})) -> list[Picture]:
    """All pictures of a soak and of its forecasts, with captions."""
    surroundings_words = (
        "Conditions during the soak: the sensor's temperature, its supply, and the noise of single samples hour by "
        "hour."
    )
    noise = (
        "Difference of neighbouring means of the still record over the time of a mean: white noise falls with the "
        "square root of time, drift rises with it."
    )
    approach = APPROACH if any(course.state for course in soak.courses.values()) else ""
    course = f"{DOTS}{approach}.{STILL if soak.holds.n else ''}"
    pictures = [Picture("drift", "Bias and scale factor since power-on", course, drift(soak))]
    if histories:
        pictures.append(
            Picture("foreseen", "Forecasts of the final values", FORECAST_LEGEND, forecasts(soak, histories))
        )
    if not soak.holds.n:  # the run ended before the first block of the still record
        return pictures
    pictures.append(Picture("night", "Temperature, supply and noise", surroundings_words, surroundings(soak)))
    times_s, _ = soak.allan(soak.axes[0])
    return [*pictures, Picture("allan", "Allan deviation", noise, allan(soak))] if len(times_s) else pictures


def drift(soak: Soak) -> Chart:
    """A column for each axis: bias above, scale factor below, as change from the final value."""
    bias_row, scale_row = [], []
    factor, unit = in_milli(soak.table.unit)
    for axis in soak.axes:
        bias = soak.courses[f"bias-{axis}"]
        bias_row.append(_course(soak, bias, factor, f"bias − final value ({unit})", f"axis {axis}"))
        scale = soak.courses[f"scale-{axis}"]
        scale_row.append(_course(soak, scale, 1e6 / _final(scale), "scale factor − final value (ppm)"))
    return Chart((tuple(bias_row), tuple(scale_row)), 2.9, share_x=True)


def forecasts(soak: Soak, histories: Mapping[str, ForecastHistory]) -> Chart:
    """A column for each axis: forecasts of the final bias and scale factor, less the last forecast."""
    rows = []
    scales = (("bias", "bias", *in_milli(soak.table.unit)), ("scale", "scale factor", 1e6, "ppm"))
    for quantity, name, factor, unit in scales:
        panels = []
        for axis in soak.axes:
            course = histories.get(f"{quantity}-{axis}")
            title, y = f"axis {axis}" if quantity == "bias" else "", f"{name} forecast ({unit})"
            if course is None:
                panels.append(Panel((), Axis(TIME), Axis(y), title))
                continue
            scale_of_change = 1.0 if quantity == "bias" else course.last.final.value
            panels.append(_forecast(course, factor / scale_of_change, COLOURS[axis], y, title))
        rows.append(tuple(panels))
    return Chart(tuple(rows), 2.6, share_x=True)


def _forecast(course: ForecastHistory, factor: float, colour: str, label: str, title: str) -> Panel:
    """Bounds of the final value, and the drift, against the time of the forecast."""
    hours = np.array([forecast.t_s for forecast in course.forecasts]) / HOUR_S
    low, value, high = (factor * (np.array(column) - course.last.final.value)
                        for column in zip(*(forecast.final for forecast in course.forecasts), strict=True))  # fmt: skip
    drift_now = factor * (np.array([forecast.present.value for forecast in course.forecasts]) - course.last.final.value)
    reach = WINDOW * max(np.abs(drift_now).max(), (high[-1] - low[-1]) / 2)
    series: list[Series] = [
        Band(hours, low, high, colour=colour, opacity=0.25),
        Line(hours, value, colour=colour, width=1.8),
        Line(hours, drift_now, colour=INK, width=1.1, dash="dot"),
    ]
    words = "not known at the end"
    if course.known_s is not None:
        series.append(Rule(course.known_s / HOUR_S, "x", INK, 1.1, "dash"))
        words = f"known after {rounded(course.known_s / HOUR_S)} h"
    series.append(Note(words, 1, 1, "xy", "right", "top"))
    return Panel(tuple(series), Axis(TIME, low=0.0), Axis(label, low=-reach, high=reach), title)


def surroundings(soak: Soak) -> Chart:
    """Temperature, supply and noise over the hours, as far as they were measured."""
    still_table, begin = soak.holds, Axis(TIME, low=_begin_h(soak))
    panels = []
    for name, label, colour in (("temperature_c", "sensor (°C)", AMBER), ("supply_v", "supply (V)", GREEN)):
        if name in still_table:
            line = Line(*_thin(still_table.time_s / HOUR_S, still_table.column(name)), colour=colour)
            panels.append(Panel((*_gaps(soak), line), begin, Axis(label)))
    lines, (factor, unit) = [], in_milli(soak.table.unit)
    for axis in soak.axes:
        times_s, rms = soak.noise_of_hours(axis)
        lines.append(Line(times_s / HOUR_S, factor * rms, f"axis {axis}", COLOURS[axis], markers=True))
    panels.append(Panel((*_gaps(soak), *lines), begin, Axis(f"noise, rms ({unit})"), legend="best"))
    return stack_panels(panels, 1.7)


def allan(soak: Soak) -> Chart:
    """Allan deviation of each axis on logarithmic axes, and the slope of white noise."""
    lines, (factor, unit) = [], add_prefix(soak.table.unit, max(soak.allan(axis)[1].max() for axis in soak.axes))
    for axis in soak.axes:
        times_s, deviations = soak.allan(axis)
        lines.append(Line(times_s, factor * deviations, f"axis {axis}", COLOURS[axis], markers=True))
    slope = factor * deviations[0] * np.sqrt(times_s[0] / times_s)
    lines.append(Line(times_s, slope, "white noise", QUIET, dash="dot"))
    x, y = Axis("averaging time (s)", log=True), Axis(f"Allan deviation ({unit})", log=True)
    return single_chart(Panel(tuple(lines), x, y, legend="best"), 3.0)


def _course(soak: Soak, course: QuantityHistory, factor: float, label: str, title: str = "") -> Panel:
    """A panel with one quantity as the change from its final value, times `factor`."""
    state, final, colour = course.state, _final(course), COLOURS[course.axis]
    series: list[Series] = list(_gaps(soak))
    if course.quantity == "bias" and soak.holds.n:
        t_s, volts = _shift_still(soak, course)
        series.append(Line(t_s / HOUR_S, factor * (volts - final), colour=BAND, width=0.8))
    if state is not None:
        series.append(Span(-factor * state.tolerance, factor * state.tolerance))
        t_s = np.linspace(*state.span_s, CURVE)
        curve, std = factor * (state.at(t_s) - final), factor * state.std_at(t_s)
        series.append(Band(t_s / HOUR_S, curve - std, curve + std, colour=colour, opacity=0.25))
        series.append(Line(t_s / HOUR_S, curve, colour=colour, width=1.8))
    values, stds = factor * (course.values - final), factor * course.stds
    series.append(Points(course.t_s / HOUR_S, values, colour=INK, symbol="circle-open", size=5, low=values - stds,
                         high=values + stds))  # fmt: skip
    drawn_values = np.append(values, 0.0)
    margin = 0.12 * np.ptp(drawn_values) + factor * (state.tolerance if state else 0.0)
    y = Axis(label, low=drawn_values.min() - margin, high=drawn_values.max() + margin) if margin else Axis(label)
    return Panel((*series, *_steady(course)), Axis(TIME, low=_begin_h(soak)), y, title)


def _steady(course: QuantityHistory) -> Iterator[Rule | Note]:
    """The time from which the quantity is steady."""
    time, words = course.time_s, "steady state not reached"
    if time is not None:
        yield Rule(time[0] / HOUR_S, "x", INK, 1.1, "dash")
    if course.state and course.state.from_start:
        words = "steady from the first reversal on"
    elif time is not None:
        words = f"steady after {positive_text(*(value_s / HOUR_S for value_s in time))} h"
    up = course.values[0] > course.values[-1]
    yield Note(words, 1, 1 if up else 0, "xy", "right", "top" if up else "bottom")


def _gaps(soak: Soak) -> tuple[Span, ...]:
    """Gaps of the record as shaded time."""
    ends = [(gap.start_s / HOUR_S, (gap.start_s + gap.length_s) / HOUR_S) for gap in soak.gaps]
    return tuple(Span(*end, "x", VERMILION, 0.25) for end in ends)


def _begin_h(soak: Soak) -> float | None:
    """Left end of the axes of time: power-on, unless the record began long after it."""
    times_s = soak.table.time_s  # since power-on
    return 0.0 if times_s.min() < np.ptp(times_s) else None


def _final(course: QuantityHistory) -> float:
    return course.state.final[0] if course.state else float(course.values[-1])


def _shift_still(soak: Soak, course: QuantityHistory) -> tuple[Array, Array]:
    """The still record at 0 g, shifted onto the bias: the difference is load along z."""
    t_s, volts = _thin(soak.holds.time_s, soak.holds.output(course.axis))
    return t_s, volts - np.median(volts - np.interp(t_s, course.t_s, course.values))


def _thin(t: Array, values: Array) -> tuple[Array, Array]:
    """Means of neighbours, SHOWN at most."""
    step = 1 + len(t) // SHOWN
    n = len(t) // step * step
    return t[:n].reshape(-1, step).mean(axis=1), values[:n].reshape(-1, step).mean(axis=1)
