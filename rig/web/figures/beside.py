"""Two runs beside each other: how their parameters differ, what one model leaves of both, and what differs itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from calibrations.numerals import measured
from calibrations.pictures.columns import Column
from calibrations.still.allan import Averaged
from rig.analysis.both import Again
from rig.analysis.side_by_side import DIFFERENT, Pair
from rig.web.figures.averaging import TIME
from rig.web.figures.prefixed import labelled, prefixed, spelt
from rig.web.figures.rows import Shown
from rig.web.figures.sensed import Scaled
from rig.web.figures.style import CANDIDATE, MEASURED, MODEL, Figure, Trace, axis, band, decades, figure

FIRST: dict[str, Any] = {"color": MEASURED, "symbol": "circle", "size": 7}
SECOND: dict[str, Any] = {"color": CANDIDATE, "symbol": "diamond-open", "size": 8, "line": {"width": 1.6}}
DOUBTLESS: dict[str, Any] = {"color": CANDIDATE, "symbol": "diamond", "size": 10}
BETWEEN = 2.2  # rows of room under each group: its axis
ROW_PX, AXIS_PX = 26, 56


def differences(pairs: Sequence[Pair]) -> tuple[Figure, int]:
    """The second less the first with two standard uncertainties each way, a group of rows for each unit; and how high
    the picture should be, px. Those that differ beyond that are diamonds."""
    groups: dict[str, list[Pair]] = {}
    for pair in pairs:
        groups.setdefault(pair.unit, []).append(pair)
    rows = len(pairs) + BETWEEN * len(groups)
    traces: list[Trace] = []
    axes: dict[str, Any] = {}
    top = 1.0
    for k, group in enumerate(groups.values(), 1):
        number, bottom = str(k) if k > 1 else "", top - len(group) / rows
        reach = max(abs(p.difference) + DIFFERENT * (p.std or 0.0) for p in group)
        factor, unit = prefixed(unit_of(group[0]), reach)
        traces += _group(group, factor, number)
        line = {"zeroline": True, "zerolinecolor": MODEL, "zerolinewidth": 1.2}
        axes[f"xaxis{number}"] = {**axis(labelled("difference", unit)), "anchor": f"y{number}", **line}
        names = {"domain": [max(bottom, 0.0), top], "anchor": f"x{number}", "autorange": "reversed", "showgrid": False}
        axes[f"yaxis{number}"] = {**axis(""), **names}
        top = bottom - BETWEEN / rows
    return figure(traces, "", "", "differences", dragmode=False, margin={"b": 4}, **axes), round(
        ROW_PX * len(pairs) + AXIS_PX * len(groups)
    )


def residuals(first: Shown, second: Shown, x: Column, other_x: Column) -> Figure:
    """What the model leaves of both, each fitted by itself, on shared axes; the grey band is the larger noise floor."""
    traces = [
        _dots(shown, column, look, name)
        for shown, column, look, name in ((first, x, FIRST, "first"), (second, other_x, SECOND, "second"))
    ]
    ticks = {"dtick": 90} if x.name == "beta" else {}
    return figure(traces, x.labels[first.c], first.label, f"{x.name} {first.unit}", xaxis=ticks, dragmode="zoom",
                  shapes=[band(max(first.floor, second.floor))])  # fmt: skip


def difference(first: Shown, found: Again) -> Figure:
    """What was measured the second time less the first, at every pose that both have; the band is its noise floor."""
    c, table = first.c, first.fit.table
    values = first.factor * found.difference[c]
    dots: Trace = {
        "type": "scatter",
        "mode": "markers",
        "x": table.column("beta_deg")[found.first].tolist(),
        "y": values.tolist(),
        "text": [first.place(int(row)) for row in found.first],
        "hovertemplate": f"%{{y:.4g}} {first.unit}<br>%{{text}}<extra></extra>",
        "marker": {"color": MEASURED, "size": 7},
    }
    label = f"second − first, {first.fit.channels[c]} ({first.unit})"
    return figure([dots], "β (deg)", label, f"difference {first.unit}", xaxis={"dtick": 90}, dragmode="zoom",
                  shapes=[band(first.factor * float(found.floor[c]))])  # fmt: skip


def deviations(first: Averaged, second: Averaged, into: tuple[Scaled, Scaled]) -> Figure:
    """The Allan deviations of two still records, bars intervals of 95 %; lines are the model fitted to each."""
    traces: list[Trace] = []
    for curve, look, by, name in ((first, FIRST, into[0], "first"), (second, SECOND, into[1], "second")):
        above, below = by.factor * (curve.high - curve.measured), by.factor * (curve.measured - curve.low)
        bars = {"type": "data", "symmetric": False, "array": above.tolist(), "arrayminus": below.tolist(), "width": 0}
        at = {"type": "scatter", "x": curve.tau_s.tolist()}
        told = f"{name}: %{{y:.3g}} {by.unit} at %{{x:.4g}} s<extra></extra>"
        line = {"color": look["color"], "width": 1.2, "dash": "solid" if name == "first" else "dash"}
        model = (by.factor * curve.modelled).tolist()
        traces.append({**at, "mode": "lines", "y": model, "line": line, "hoverinfo": "skip"})
        traces.append({**at, "mode": "markers", "y": (by.factor * curve.measured).tolist(), "marker": look,
                       "error_y": {**bars, "thickness": 1}, "hovertemplate": told})  # fmt: skip
    label = f"Allan deviation ({into[0].unit})"
    return figure(traces, TIME, label, f"allan {into[0].unit}", **decades(), dragmode="zoom")


def unit_of(pair: Pair) -> str:
    """For people."""
    return spelt(pair.unit)


def _group(group: Sequence[Pair], factor: float, number: str) -> list[Trace]:
    """Differences that share a unit, as dots with their intervals: those beyond doubt, and the others."""
    made = []
    for differ, look in ((False, FIRST), (True, DOUBTLESS)):
        pairs = [pair for pair in group if pair.differ == differ]
        spread = [DIFFERENT * factor * (pair.std or 0.0) for pair in pairs]
        told = [f"{measured(pair.difference, pair.std)} {unit_of(pair)}" for pair in pairs]
        bars = {"type": "data", "array": spread, "width": 4, "thickness": 1.6, "color": look["color"]}
        made.append({"type": "scatter", "mode": "markers", "x": [factor * pair.difference for pair in pairs],
                     "y": [pair.name for pair in pairs], "xaxis": f"x{number}", "yaxis": f"y{number}", "error_x": bars,
                     "marker": look, "text": told, "hovertemplate": "%{y}: %{text}<extra></extra>"})  # fmt: skip
    return made


def _dots(shown: Shown, x: Column, look: dict[str, Any], name: str) -> Trace:
    values = x.values[shown.c, shown.rows]
    told = [f"{name}: {each}" for each in shown.hover]
    return {"type": "scatter", "mode": "markers", "x": np.asarray(values).tolist(), "y": shown.residual.tolist(),
            "text": told, "hovertemplate": "%{text}<extra></extra>", "marker": look}  # fmt: skip
