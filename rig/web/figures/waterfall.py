"""The falling error: one bar for the model as it was, one more for each effect added, down to the noise floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log10

from calibrations.numerals import plain
from calibrations.pictures.waterfall import Level
from rig.web.figures.style import FLOOR, GOOD, MEASURED, MODEL, UNSEEN, Figure, Trace, figure

BELOW = 0.5  # times the floor: where the logarithmic axis begins
FEWEST = 4  # bars that there is room for: one alone is no thicker than they
NEAR = 1.15  # times the floor: as good as noise


@dataclass(frozen=True)
class Measure:
    """What is told of a level: over what its error is given, and which rows it saw and did not see."""

    axis: str = "rms error / noise floor"
    over: str = "the floor"
    seen: str = "rows of the fit"
    unseen: str = "unseen rows"


def waterfall(steps: Sequence[Level], told: Measure = Measure()) -> Figure:
    """Errors over the noise floor: bars on the rows of the fit, diamonds on rows that it did not see."""
    names, seen = [level.name for level in steps], [level.seen for level in steps]
    colours = [MODEL, *(GOOD if value < NEAR else MEASURED for value in seen[1:])]
    bars: Trace = {
        "type": "bar",
        "orientation": "h",
        "y": names,
        "x": [max(value - BELOW, 0.0) for value in seen],
        "base": BELOW,
        "marker": {"color": colours},
        "width": 0.6,
        "text": [f"\u2003{plain(level.seen)} × ({level.rms})\u2003" for level in steps],
        "textposition": "auto",
        "insidetextanchor": "start",
        "hovertemplate": [f"{level.name}: {plain(level.seen)} × {told.over} on {told.seen}" for level in steps],
        "name": "",
    }
    diamonds: Trace = {
        "type": "scatter",
        "mode": "markers",
        "y": names,
        "x": [level.unseen for level in steps],
        "marker": {"symbol": "diamond", "size": 10, "color": UNSEEN, "line": {"width": 1, "color": "#1f2933"}},
        "hovertemplate": [f"{plain(level.unseen)} × {told.over} on {told.unseen}" for level in steps],
        "name": "",
    }
    reach = 2.2 * max(*seen, *(level.unseen for level in steps), 3.0)
    x = {"type": "log", "range": [log10(BELOW), log10(reach)], "dtick": 1}
    y = {"range": [max(len(steps), FEWEST) - 0.5, -0.5], "title": {"text": ""}}
    floor = {"type": "rect", "layer": "below", "fillcolor": FLOOR, "line": {"width": 0}, "yref": "paper"}
    shapes = [{**floor, "x0": BELOW, "x1": 1, "y0": 0, "y1": 1}]
    return figure([bars, diamonds], told.axis, "", "waterfall", xaxis=x, yaxis=y, dragmode=False, shapes=shapes)
