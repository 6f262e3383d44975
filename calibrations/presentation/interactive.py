"""Charts as plain mappings that Plotly draws in a page; `keep` names what keeps its zoom when the chart is redrawn.

Text and grid take the page's colours (`workbench.css`), which knows whether it is dark.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from functools import singledispatch
from typing import Any, Literal

import numpy as np

from calibrations.presentation import chart as c
from calibrations.text import exponent, tick_text

Figure = dict[str, Any]
Trace = dict[str, Any]

EDGE = "rgba(105,115,125,0.9)"  # separates pale and dark markers from white and dark paper
CONFIG = {
    "displaylogo": False,
    "responsive": True,
    "scrollZoom": False,
    "modeBarButtonsToRemove": ["toImage", "autoScale2d", "zoomIn2d", "zoomOut2d"],
}
SIZE = 11.5  # of the letters, px
MARGIN = {"l": 62, "r": 12, "t": 8, "b": 44}
ROW_GAP = 56  # px below a row of panels: its axis
COLUMN_GAP = 0.09  # of the width, left of a panel: its axis
SYMBOLS = {"cross": "cross-thin-open"}
DAY_S = 86400.0
FEW_INTEGERS = 12  # each has its mark
TITLE_PX, LEGEND_PX = 22, 18  # above panels
ROUNDING = 1e-9
NOTE_PX = {"left": 4, "center": 0, "right": -4}
INCH_PX = 96
BAR_STEP = 0.12  # of the width of the panels, from one colour bar to the next
BAR = {"thickness": 10, "outlinewidth": 0, "xpad": 4, "exponentformat": "none"}


def figure(chart: c.Chart, keep: str, drag: Literal["select", "zoom", False] = "zoom") -> Figure:
    """Data, layout and configuration for Plotly. `drag`: the effect of drawing a box."""
    data: list[Trace] = []
    layout: dict[str, Any] = {
        "barmode": "overlay",  # as the static renderer draws bars: the later over the earlier
        "margin": dict(MARGIN),
        "showlegend": False,
        "hovermode": "closest",
        "dragmode": drag,
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"family": "inherit", "size": SIZE},
        "uirevision": keep,
        "shapes": [],
        "annotations": [],
    }
    places = list(_places(chart))
    for number, (panel, x_domain, y_domain) in enumerate(places, 1):
        _panel(panel, "" if number == 1 else str(number), x_domain, y_domain, data, layout)
        if len(places) > 1 and (panel.title or panel.remark):
            layout["margin"]["t"] = TITLE_PX + LEGEND_PX
            layout["annotations"] += [
                _refer_to_panel(title, str(number) if number > 1 else "") for title in _titles(panel)
            ]
    _share_axes(chart, layout)
    _one_bar_a_scale(data)
    return {"data": data, "layout": layout, "config": CONFIG}


def _titles(panel: c.Panel) -> Iterator[dict[str, Any]]:
    """Title and remark of a panel, above its left and right end."""
    title_style = {"y": 1, "yref": "y domain", "yanchor": "bottom", "xref": "x domain", "showarrow": False,
             "yshift": 2 + LEGEND_PX * bool(panel.legend)}  # fmt: skip
    if panel.title:
        yield title_style | {"text": f"<b>{panel.title}</b>", "x": 0, "xanchor": "left"}
    if panel.remark:
        yield title_style | {"text": panel.remark, "x": 1, "xanchor": "right"}


def _share_axes(chart: c.Chart, layout: dict[str, Any]) -> None:
    """Vertical axes of a row follow the first one of that row."""
    first = 1
    for row in chart.panels if chart.share_y else ():
        for number in range(first + 1, first + len(row)) if row[0].y.low is None else ():
            layout[f"yaxis{number}"]["matches"] = f"y{first if first > 1 else ''}"
        first += len(row)


def _one_bar_a_scale(data: Sequence[Trace]) -> None:
    """Panels with the same scale share a colour bar; bars of other scales follow to the right."""
    bars: list[str] = []
    for marker in (trace["marker"] for trace in data if "colorbar" in trace.get("marker", {})):
        label = marker["colorbar"]["title"]["text"]
        marker["showscale"] = label not in bars
        if marker["showscale"]:
            marker["colorbar"] = marker["colorbar"] | {"x": 1.02 + BAR_STEP * len(bars)}
            bars.append(label)


def height_px(chart: c.Chart) -> int:
    """Height of a chart with several rows."""
    return round(sum(chart.heights) * INCH_PX + ROW_GAP)


def _places(chart: c.Chart) -> Iterator[tuple[c.Panel, list[float] | None, list[float] | None]]:
    total, top = sum(chart.heights), 1.0
    gap = ROW_GAP / (total * INCH_PX)
    for row, height in zip(chart.panels, chart.heights, strict=True):
        bottom = top - height / total
        for j, panel in enumerate(row):
            x = None if len(row) == 1 else [j / len(row) + COLUMN_GAP * (j > 0), (j + 1) / len(row)]
            y = None if len(chart.panels) == 1 else [min(max(bottom, 0.0) + gap * (bottom > 1e-9), top), top]
            yield panel, x, y
        top = bottom


def _panel(panel: c.Panel, number: str, x: Any, y: Any, data: list[Trace], layout: dict[str, Any]) -> None:
    axes = {"xaxis": f"x{number}", "yaxis": f"y{number}"}
    for series in panel.series:
        traces, shapes, notes = _series(series, panel)
        data += [{**trace, **axes, "legend": f"legend{number}"} if number else trace for trace in traces]
        layout["shapes"] += [_refer_to_panel(shape, number) for shape in shapes]
        layout["annotations"] += [_refer_to_panel(note, number) for note in notes]
    for side, axis, domain, other in (("x", panel.x, x, "y"), ("y", panel.y, y, "x")):
        settings = _axis(axis) | ({"domain": domain} if domain else {})
        layout[f"{side}axis{number}"] = settings | ({"anchor": f"{other}{number}"} if number else {})
    if panel.equal:
        layout[f"yaxis{number}"]["scaleanchor"] = f"x{number}"
    if panel.legend:
        layout["showlegend"] = True
        layout[f"legend{number}"] = {"orientation": "h", "x": (x or [0.0])[0], "xanchor": "left", "yanchor": "bottom",
                                     "y": (y or [0.0, 1.0])[1], "bgcolor": "rgba(0,0,0,0)"}  # fmt: skip
    if panel.x.ticks == "dates":
        layout["margin"] |= {"t": 20, "b": 24}


def _refer_to_panel(shape: dict[str, Any], number: str) -> dict[str, Any]:
    """The shape or annotation on the axes of its panel."""
    return {
        name: f"{value}{number}" if value in ("x", "y") else f"{value[0]}{number} domain" if value in DOMAINS else value
        for name, value in shape.items()
    }


DOMAINS = ("x domain", "y domain")


def _axis(axis: c.Axis) -> dict[str, Any]:
    settings: dict[str, Any] = {"zeroline": False, "automargin": True, "exponentformat": "none"}
    settings["title"] = {"text": axis.label, "standoff": 6, "font": {"size": SIZE}}
    if axis.log:
        settings |= {"type": "log", "exponentformat": "power", "dtick": 1, "tickfont": {"size": SIZE - 2}}
        settings |= _marks(axis)
    if axis.names:
        settings |= {"tickvals": list(range(len(axis.names))), "ticktext": list(axis.names), "showgrid": False}
    if axis.ticks == "quarters":
        settings["dtick"] = 90
    if axis.ticks == "integers":
        settings["tickformat"] = "d"
        if axis.low is not None and axis.high is not None and axis.high - axis.low < FEW_INTEGERS:
            settings["dtick"] = 1
    if axis.ticks == "dates":
        settings["type"] = "date"
    ends = [None if end is None else _position(axis, end) for end in (axis.low, axis.high)]
    if ends != [None, None]:
        settings["range"] = ends[::-1] if axis.reverse else ends
    elif axis.reverse:
        settings["autorange"] = "reversed"
    return settings


def _position(axis: c.Axis, value: float) -> float | str:
    """A value on an axis as Plotly wants the ends of a range."""
    if axis.ticks == "dates":
        return _dates([value])[0]
    return float(np.log10(value)) if axis.log else value


def _marks(axis: c.Axis) -> dict[str, Any]:
    """Marks at 1, 2 and 5 times powers of ten, where the axis has few of these powers."""
    if axis.low is None or axis.high is None or np.log10(axis.high / axis.low) >= c.FEW_DECADES:
        return {}
    powers = range(exponent(axis.low), exponent(axis.high) + 1)
    values = [digit * 10.0**power for power in powers for digit in (1, 2, 5)]
    visible = [value for value in values if axis.low <= value * (1 + ROUNDING) and value <= axis.high * (1 + ROUNDING)]
    return {"tickmode": "array", "tickvals": visible, "ticktext": [tick_text(value) for value in visible]}


Parts = tuple[list[Trace], list[dict[str, Any]], list[dict[str, Any]]]  # traces, shapes, annotations


@singledispatch
def _series(series: c.Series, panel: c.Panel) -> Parts:  # noqa: ARG001 the arguments of all kinds
    raise TypeError(series)


@_series.register
def _points(s: c.Points, panel: c.Panel) -> Parts:
    trace = _trace(s, panel, "markers") | {"marker": _marker(s)}
    if s.low is not None and s.high is not None:
        upper, lower = np.asarray(s.high) - s.y, np.asarray(s.y) - s.low
        ends = {"symmetric": False, "array": _list(upper), "arrayminus": _list(lower)}
        trace["error_y"] = ends | {"type": "data", "width": 0, "thickness": 1, "color": _bar_colour(s)}
    if s.reach is not None:
        trace["error_x"] = {"type": "data", "array": _list(s.reach), "width": 4, "thickness": 1.6,
                            "color": _bar_colour(s)}  # fmt: skip
    if s.keys is not None:
        trace["customdata"] = list(s.keys)
    if len(s.hover):
        trace |= {"text": list(s.hover), "hovertemplate": "%{text}<extra></extra>"}
    return [trace], [], []


def _bar_colour(s: c.Points) -> str:
    """Bars of one trace have one colour."""
    return _visible(s.colour) if isinstance(s.colour, str) and s.values is None else c.BAND


def _marker(s: c.Points) -> dict[str, Any]:
    symbols = s.symbol if isinstance(s.symbol, str) else list(s.symbol)
    names = SYMBOLS.get(symbols, symbols) if isinstance(symbols, str) else [SYMBOLS.get(n, n) for n in symbols]
    marker: dict[str, Any] = {"symbol": names, "size": s.size, "line": {"width": 0.6, "color": EDGE}}
    if isinstance(symbols, str) and not symbols.endswith("-open") and s.values is None:
        marker["line"] = {"width": 0}
    if s.values is None or s.scale is None:
        return marker | {"color": _visible(s.colour) if isinstance(s.colour, str) else list(s.colour)}
    scale = s.scale
    colours: tuple[str, ...] = c.SIGNED_COLOURS if scale.signed else c.VALUES
    bar = BAR | {"title": {"text": scale.label, "side": "right", "font": {"size": SIZE}}}
    if scale.names:
        colours = (c.BLUE, c.VERMILION, c.GREEN)[: max(len(scale.names), 2)]
        bar |= {"tickvals": list(range(len(scale.names))), "ticktext": list(scale.names)}
    stops = [[k / (len(colours) - 1), colour] for k, colour in enumerate(colours)]
    return marker | {"color": _list(s.values), "colorscale": stops, "cmin": scale.low, "cmax": scale.high,
                     "colorbar": bar}  # fmt: skip


@_series.register
def _line(s: c.Line, panel: c.Panel) -> Parts:
    look = {"color": _visible(s.colour), "width": s.width, "dash": s.dash}
    trace = _trace(s, panel, "lines+markers" if s.markers else "lines") | {"line": look}
    trace |= {"hovertemplate": f"{s.hover}<extra></extra>"} if s.hover else {"hoverinfo": "skip"}
    trace |= {"text": list(s.texts)} if s.texts else {}
    halo = {**trace, "line": {"color": "rgba(255,255,255,0.85)", "width": 2 * s.width}, "hoverinfo": "skip",
            "showlegend": False}  # fmt: skip
    return ([halo, trace] if s.halo else [trace]), [], []


@_series.register
def _band(s: c.Band, panel: c.Panel) -> Parts:
    shape = "hvh" if s.steps else "linear"
    edge = {"type": "scatter", "mode": "lines", "line": {"width": 0, "shape": shape}, "hoverinfo": "skip",
            "x": _list(s.x, panel.x), "showlegend": False}  # fmt: skip
    fill = {"fill": "tonexty", "fillcolor": _clear(s.colour, s.opacity), "name": s.label, "showlegend": bool(s.label)}
    return [edge | {"y": _list(s.low)}, edge | {"y": _list(s.high)} | fill], [], []


@_series.register
def _span(s: c.Span, panel: c.Panel) -> Parts:
    other: c.Along = "x" if s.along == "y" else "y"
    shape = {"type": "rect", "layer": "below", "fillcolor": _clear(s.colour, s.opacity), "line": {"width": 0}}
    ends = _list(np.array([s.low, s.high]), panel.x if s.along == "x" else None)
    sides = {f"{s.along}0": ends[0], f"{s.along}1": ends[1], f"{s.along}ref": s.along}
    return [], [shape | _whole_side(other) | sides], []


@_series.register
def _rule(s: c.Rule, panel: c.Panel) -> Parts:
    other: c.Along = "x" if s.along == "y" else "y"
    position = _list(np.array([s.at]), panel.x if s.along == "x" else None)[0]
    look = {"color": _visible(s.colour), "width": s.width, "dash": s.dash}
    shape = {"type": "line", "layer": "below", "line": look, f"{s.along}0": position, f"{s.along}1": position}
    return [], [shape | _whole_side(other) | {f"{s.along}ref": s.along}], []


@_series.register
def _bars(s: c.Bars, panel: c.Panel) -> Parts:
    starts = {} if s.starts is None else {k: start for k, start in enumerate(s.starts) if not s.inside[k]}
    trace = {
        "type": "bar",
        "orientation": "h",
        "y": list(range(len(s.ends))),
        "x": [max(float(end) - s.base, 0.0) for end in s.ends],
        "base": s.base,
        "marker": {"color": list(s.colours)},
        "width": 0.6,
        "text": [f"\u2003{text}\u2003" if k not in starts else "" for k, text in enumerate(s.texts)],
        "textposition": ["auto" if inside else "outside" for inside in s.inside],  # outside a bar of few pixels
        "textangle": 0,
        "constraintext": "none",  # readable in a low bar too
        "insidetextanchor": "start",
        "hovertemplate": [f"{name}: {text}" for name, text in zip(panel.y.names, s.texts, strict=True)],
        "name": s.label,
    }
    after = [c.Note(f"\u2003{s.texts[k]}", float(start), k, vertical="middle") for k, start in starts.items()]
    return [trace], [], [note for text in after for note in _note(text, panel)[2]]


@_series.register
def _cells(s: c.Cells, panel: c.Panel) -> Parts:  # noqa: ARG001
    stops = [[k / (len(c.SIGNED_COLOURS) - 1), colour] for k, colour in enumerate(c.SIGNED_COLOURS)]
    trace = {"type": "heatmap", "z": np.asarray(s.values).tolist(), "zmin": -1, "zmax": 1, "colorscale": stops,
             "showscale": False, "text": [list(row) for row in s.texts], "texttemplate": "%{text}"}  # fmt: skip
    return [trace], [], []


@_series.register
def _note(s: c.Note, panel: c.Panel) -> Parts:
    x = s.x if "x" in s.shares else _list(np.array([s.x]), panel.x)[0]
    note = {"text": s.text, "x": _power(x, panel.x, "x" in s.shares), "y": _power(s.y, panel.y, "y" in s.shares),
            "showarrow": False, "xanchor": s.horizontal, "xshift": NOTE_PX[s.horizontal],
            "yanchor": s.vertical, "textangle": -90 if s.upright else 0,
            "xref": "x domain" if "x" in s.shares else "x", "yref": "y domain" if "y" in s.shares else "y"}  # fmt: skip
    return [], [], [note]


def _power(value: Any, axis: c.Axis, share: bool) -> Any:
    """An annotation's place on a logarithmic axis is the logarithm."""
    return float(np.log10(value)) if axis.log and not share else value


def _trace(s: c.Points | c.Line, panel: c.Panel, mode: str) -> Trace:
    return {"type": "scatter", "mode": mode, "x": _list(s.x, panel.x), "y": _list(s.y), "name": s.label,
            "showlegend": bool(s.label)}  # fmt: skip


def _whole_side(direction: c.Along) -> dict[str, Any]:
    return {f"{direction}ref": f"{direction} domain", f"{direction}0": 0, f"{direction}1": 1}


def _list(values: Any, axis: c.Axis | None = None) -> list[Any]:
    """Numbers for JSON, None for NaN; dates as texts for Plotly."""
    numbers = np.asarray(values, float).tolist()
    if axis is not None and axis.ticks == "dates":
        return _dates(numbers)
    return [None if number != number else number for number in numbers]


def _dates(days: Sequence[float]) -> list[str]:
    """Days since 1970 as Plotly reads times."""
    return [datetime.fromtimestamp(day * DAY_S, tz=UTC).strftime("%Y-%m-%d %H:%M:%S") for day in days]


def _visible(colour: str) -> str:
    """Ink would vanish on dark paper."""
    return c.QUIET if colour == c.INK else colour


def _clear(colour: str, opacity: float) -> str:
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity:g})"
