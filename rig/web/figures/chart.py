"""Control charts of one quantity over a sensor's calibrations: individuals, EWMA and moving ranges, with limits."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibrations.evaluations.control_chart import Chart
from calibrations.numerals import plain
from calibrations.table import Array
from rig.analysis.history import Quantity
from rig.web.figures.prefixed import labelled, prefixed, spelt
from rig.web.figures.series import BAND
from rig.web.figures.style import CANDIDATE, FLOOR, MEASURED, Figure, Trace, figure

INDIVIDUALS, EWMA, RANGES = "Individuals: a jump", "EWMA: a slow drift", "Moving ranges"
FEW = 12  # calibrations that are all numbered


@dataclass(frozen=True)
class _Part:
    """One of the charts: values from the calibration number `first` on, between limits, less the centre."""

    values: Array
    low: Array
    high: Array
    beyond: Collection[int]
    judged: int
    label: str
    first: int = 1


def charts(q: Quantity, chart: Chart) -> dict[str, Figure]:
    """By title. Open dots are of the baseline, which sets the limits; diamonds are beyond them."""
    since, slow = chart.judged, chart.ewma_reach
    reach, limit = np.full(len(chart.values), chart.reach), np.full(len(chart.ranges), chart.range_limit)
    parts = {
        INDIVIDUALS: _Part(chart.values - chart.centre, -reach, reach, chart.jumps, since, "less the centre"),
        EWMA: _Part(chart.ewma - chart.centre, -slow, slow, chart.drifts, since, "less the centre"),
        RANGES: _Part(chart.ranges, 0 * limit, limit, (), since - 1, "range", first=2),
    }
    return {title: _figure(q, part, title) for title, part in parts.items()}


def _figure(q: Quantity, part: _Part, title: str) -> Figure:
    factor, unit = prefixed(spelt(q.unit), float(np.abs([part.values, part.high]).max()))
    numbers = list(range(part.first, part.first + len(part.values)))
    band = [{**BAND, "x": numbers, "y": (factor * edge).tolist(), "line": {"width": 0, "shape": "hvh"}}
            for edge in (part.low, part.high)]  # fmt: skip
    band[1] |= {"fill": "tonexty", "fillcolor": FLOOR}
    values, of = (factor * part.values).tolist(), q.of[part.first - 1 :]
    dots: Trace = {
        "type": "scatter",
        "mode": "lines+markers",
        "x": numbers,
        "y": values,
        "line": {"color": MEASURED, "width": 1},
        "customdata": [each.data for each in of],
        "text": [
            f"{each.day}: {plain(value)} {unit}" for each, value in zip(q.of[part.first - 1 :], values, strict=True)
        ],
        "hovertemplate": "%{text}<br>click: its model<extra></extra>",
        "marker": _marks(part),
    }
    x = {"dtick": 1 if len(numbers) < FEW else None}
    return figure(
        [*band, dots], "calibration", labelled(part.label, unit), f"{title} {q.name}", xaxis=x, dragmode="zoom"
    )


def _marks(part: _Part) -> dict[str, Any]:
    """Not by colour alone."""
    shapes = ["diamond" if k in part.beyond else "circle" for k in range(len(part.values))]
    colours = [CANDIDATE if shape == "diamond" else MEASURED for shape in shapes]
    return {
        "symbol": [f"{shape}-open" if k < part.judged else shape for k, shape in enumerate(shapes)],
        "color": colours,
        "size": [11 if shape == "diamond" else 7 for shape in shapes],
        "line": {"width": 1.6, "color": colours},
        "opacity": 1,
    }
