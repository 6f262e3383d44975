"""Charts of a sensor's life: calibrations with uncertainty, drift, limits and due date; and control charts."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibrations.analyses.control_chart import Chart as ControlChart
from calibrations.analyses.stability import Stability
from calibrations.criteria import COVERAGE_FACTOR
from calibrations.presentation.chart import (
    CANDIDATE,
    MEASURED,
    Axis,
    Band,
    Chart,
    Line,
    Note,
    Panel,
    Points,
    Rule,
    Symbol,
    stack_panels,
)
from calibrations.table import Array
from calibrations.text import add_prefix, axis_label, rounded, unit

POINTS = 200
AHEAD = 0.5  # of the time from first to last calibration: length of the drawn drift after the last
MARGIN = 0.03  # of the time shown, at both ends
ALONE_DAYS = 30.0  # around calibrations of one moment
INDIVIDUALS, EWMA, RANGES = "Single runs", "Weighted mean of the runs (EWMA)", "Change from run to run"
CONTROL_LEGENDS = {
    INDIVIDUALS: "◆ outside the band: the value has jumped; ○: these runs set the band",
    EWMA: "newer runs count more; ◆ outside the band: the value drifts",
    RANGES: "difference from the run before; above the band: the runs scatter more",
}


@dataclass(frozen=True)
class Life:
    """One quantity over n calibrations: days since 1970, values, standard uncertainties; hover texts and keys.

    `signals` are the numbers of those that a control chart signals.
    """

    name: str
    unit: str
    t_days: Sequence[float]
    values: Sequence[float]
    stds: Sequence[float]
    line: Stability | None = None
    allowed: tuple[float, float] | None = None
    due_days: float | None = None
    due: str = ""
    signals: Collection[int] = ()
    hover: Sequence[str] = ()
    keys: Sequence[str] | None = None


def lives(quantities: Sequence[Life]) -> Chart:
    """A panel for each quantity, over the time of all of them."""
    ends = [_ends(quantity) for quantity in quantities]
    x = _dates(min(start for start, _ in ends), max(end for _, end in ends))
    return stack_panels([replace(life(quantity), x=x) for quantity in quantities], 2.2)


def _dates(start: float, end: float) -> Axis:
    margin = MARGIN * (end - start)
    return Axis(low=start - margin, high=end + margin, ticks="dates")


def life(q: Life) -> Panel:
    """Dots are calibrations with two standard uncertainties each way, diamonds those that a chart signals.

    The band is the 95 % interval of the value at that time, without the uncertainty of a calibration.
    """
    factor, spelt = add_prefix(unit(q.unit), max(map(abs, q.values)))
    values, expanded = factor * np.array(q.values), COVERAGE_FACTOR * factor * np.array(q.stds)
    start, end = _ends(q)
    signals = [k in q.signals for k in range(len(values))]
    series: list[Band | Line | Rule | Note | Points] = list(_drift(q, start, end, factor))
    if q.allowed is not None:
        lowest, highest = (factor * limit for limit in q.allowed)
        series += [
            Rule(lowest, colour=CANDIDATE, width=1.4, dash="dash"),
            Note("lowest allowed", 0.01, lowest, "x"),
            Rule(highest, colour=CANDIDATE, width=1.4, dash="dash"),
            Note("highest allowed", 0.01, highest, "x", vertical="top"),
        ]
    if q.due_days is not None:
        series += [Rule(q.due_days, "x", CANDIDATE, 1.6), Note(q.due, q.due_days, 1, "y", "right")]
    series.append(
        Points(np.array(q.t_days), values, colour=[CANDIDATE if s else MEASURED for s in signals],
               symbol=["diamond" if s else "circle" for s in signals], size=8, low=values - expanded,
               high=values + expanded, hover=q.hover, keys=q.keys)
    )  # fmt: skip
    return Panel(tuple(series), _dates(start, end), Axis(axis_label(q.name, spelt)), q.name)


def _ends(q: Life) -> tuple[float, float]:
    """First and last day of the chart: some way ahead, and until the next calibration is due."""
    first, last = q.t_days[0], q.t_days[-1]
    end = max(last + AHEAD * (last - first), q.due_days or last)
    return (first, end) if end - first > 1 else (first - ALONE_DAYS, last + ALONE_DAYS)


def _drift(q: Life, start: float, end: float, factor: float) -> tuple[Band | Line, ...]:
    if q.line is None:
        return ()
    days = np.linspace(max(start, q.line.t_days[0]), end, POINTS)
    value, std = q.line.predict(days)
    reach = q.line.coverage * std
    return Band(days, factor * (value - reach), factor * (value + reach)), Line(days, factor * value, width=1.6)


def control_charts(charts: Mapping[str, ControlChart], units: Mapping[str, str]) -> Chart:
    """A row for each quantity: single runs, their weighted mean, and moving ranges."""
    rows = tuple(tuple(control_panels(name, chart, units[name]).values()) for name, chart in charts.items())
    return Chart(rows, 2.3, share_x=True)


def control_panels(
    name: str, chart: ControlChart, unit_name: str, hover: Sequence[str] = (), keys: Sequence[str] | None = None
) -> dict[str, Panel]:
    """The three charts of one quantity by title; values are differences from the centre.

    Open dots are the baseline, which sets the limits (the band); diamonds are beyond the limits.
    """
    reach, limit = np.full(len(chart.values), chart.reach), np.full(len(chart.ranges), chart.range_limit)
    slow, judged_from, change = chart.ewma_reach, chart.judged, f"{name} − centre"
    centre = f"centre {chart.centre:.6g} {unit(unit_name)}".rstrip()
    parts = {
        INDIVIDUALS: (1, chart.values - chart.centre, -reach, reach, chart.jumps, judged_from, change, centre),
        EWMA: (1, chart.ewma - chart.centre, -slow, slow, chart.drifts, judged_from, change, chart.verdict),
        RANGES: (2, chart.ranges, 0 * limit, limit, (), judged_from - 1, "range", ""),
    }
    x = Axis("run", low=0.5, high=len(chart.values) + 0.5, ticks="integers")
    panels = {}
    for title, (first, values, low, high, signals, baseline_end, label, remark) in parts.items():
        factor, spelt = add_prefix(unit(unit_name), float(np.abs([values, high]).max()))
        numbers = np.arange(first, first + len(values), dtype=float)
        point_keys = None if keys is None else keys[first - 1 :]
        texts = [f"{text}: {rounded(v)} {spelt}" for text, v in zip(hover[first - 1 :], factor * values, strict=False)]
        dots = _control_points(numbers, factor * values, signals, baseline_end, texts, point_keys)
        band = Band(numbers, factor * low, factor * high, steps=True)
        series = (band, Rule(0.0, width=0.7), Line(numbers, factor * values, colour=MEASURED, width=1), dots)
        panels[title] = Panel(series, x, Axis(axis_label(label, spelt)), title, remark)
    return panels


def _control_points(
    x: Array, y: Array, signals: Collection[int], baseline_end: int, hover: Sequence[str], keys: Sequence[str] | None
) -> Points:
    """Signals differ by form and colour."""
    symbols: list[Symbol] = []
    for k in range(len(x)):
        baseline = k < baseline_end
        if k in signals:
            symbols.append("diamond-open" if baseline else "diamond")
        else:
            symbols.append("circle-open" if baseline else "circle")
    colours = [CANDIDATE if k in signals else MEASURED for k in range(len(x))]
    return Points(x, y, colour=colours, symbol=symbols, size=8, hover=hover, keys=keys)
