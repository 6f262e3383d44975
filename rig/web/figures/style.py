"""The pictures' common look: colours that the colour-blind can tell apart on light and dark, quiet axes, units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from calibrations.pictures.style import AMBER, BLUE, QUIET, VERMILION

Figure = dict[str, Any]
Trace = dict[str, Any]

MEASURED, MODEL, CANDIDATE = BLUE, QUIET, VERMILION
GOOD, UNSEEN = "#007a5a", AMBER  # green with white words on it
FLOOR = "rgba(128,138,150,0.22)"
EDGE = "rgba(105,115,125,0.9)"  # tells pale and dark dots from white and dark paper
VALUES = [[0.0, "#414487"], [0.25, "#2a788e"], [0.5, "#22a884"], [0.75, "#7ad151"], [1.0, "#e3c51a"]]  # viridis' middle
SIGNED = [[0.0, "#00456b"], [0.3, BLUE], [0.5, "#ece8df"], [0.7, VERMILION], [1.0, "#7a3300"]]
CONFIG = {
    "displaylogo": False,
    "responsive": True,
    "scrollZoom": False,
    "modeBarButtonsToRemove": ["toImage", "autoScale2d", "zoomIn2d", "zoomOut2d"],
}
SIZE = 11.5  # of the letters, px
MARGIN = {"l": 62, "r": 12, "t": 8, "b": 44}


def figure(traces: list[Trace], x: str, y: str, keep: str, **more: Any) -> Figure:
    """Traces with named axes. `keep`: zoom stays as long as it is the same. `more` joins the layout."""
    layout = {
        "margin": MARGIN,
        "showlegend": False,
        "hovermode": "closest",
        "dragmode": "select",
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"family": "inherit", "size": SIZE},
        "uirevision": keep,
        "xaxis": axis(x),
        "yaxis": axis(y),
    }
    return {"data": traces, "layout": merged(layout, more), "config": CONFIG}


def axis(title: str) -> dict[str, Any]:
    """One axis; its numbers are written in full, as units are chosen for that."""
    look = {"zeroline": False, "automargin": True, "exponentformat": "none"}
    return {"title": {"text": title, "standoff": 6, "font": {"size": SIZE}}, **look}


def decades() -> dict[str, Any]:
    """Both axes by powers of ten."""
    log = {"type": "log", "exponentformat": "power", "dtick": 1, "tickfont": {"size": SIZE - 2}}
    return {"xaxis": log, "yaxis": log}


def merged(base: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    """`more` laid over `base`, mappings within mappings joined."""
    both = dict(base)
    for name, value in more.items():
        there = both.get(name)
        both[name] = merged(there, value) if isinstance(there, Mapping) and isinstance(value, Mapping) else value
    return both


def band(floor: float) -> dict[str, Any]:
    """The noise floor around zero, one standard deviation each way, as a shape."""
    ends = {"xref": "paper", "x0": 0, "x1": 1, "y0": -floor, "y1": floor}
    return {"type": "rect", "layer": "below", "fillcolor": FLOOR, "line": {"width": 0}, **ends}


def scale(title: str) -> dict[str, Any]:
    """The bar that tells what colours mean."""
    named = {"text": title, "side": "right", "font": {"size": SIZE}}
    return {"title": named, "thickness": 10, "outlinewidth": 0, "xpad": 4, "exponentformat": "none"}


def coloured(values: list[float], title: str) -> dict[str, Any]:
    """Markers coloured by a column, with its bar."""
    bar = scale(title)
    return {"color": values, "colorscale": VALUES, "size": 6, "line": {"width": 0.6, "color": EDGE}, "colorbar": bar}
