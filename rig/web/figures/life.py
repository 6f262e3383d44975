"""One quantity over a sensor's life: every calibration, the line of its drift, what is allowed, when it is due."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime

import numpy as np

from calibrations.evaluations.agreement import COVERAGE
from calibrations.numerals import measured
from calibrations.pictures.history import AHEAD, POINTS
from rig.analysis.history import Calibration, Quantity
from rig.web.figures.prefixed import labelled, prefixed, spelt
from rig.web.figures.series import BAND
from rig.web.figures.style import CANDIDATE, EDGE, MEASURED, MODEL, Figure, Trace, figure

DAY_S = 86400.0
MARGIN = {"t": 20, "b": 24}  # room for the day that is due; the dates need no title
ALONE_DAYS = 30.0  # around calibrations of one moment, which stretch no axis


def life(q: Quantity) -> Figure:
    """Dots are calibrations with two standard uncertainties each way, those that a chart signals are diamonds; the
    band is the 95 % interval of the value then, without what a calibration is uncertain by."""
    values = [each.values[q.name] for each in q.of]
    factor, unit = prefixed(spelt(q.unit), max(abs(value.value) for value in values))
    days = [each.at.timestamp() / DAY_S for each in q.of]
    start, end = _ends(q, days)
    signals = q.chart.signals if q.chart is not None else []
    dots: Trace = {
        "type": "scatter",
        "mode": "markers",
        "x": _dates(days),
        "y": [factor * value.value for value in values],
        "error_y": {"array": [COVERAGE * factor * value.std for value in values], "width": 4, "color": MEASURED},
        "customdata": [each.data for each in q.of],
        "text": [told(q, each, k in signals) for k, each in enumerate(q.of)],
        "hovertemplate": "%{text}<extra></extra>",
        "marker": {
            "symbol": ["diamond" if k in signals else "circle" for k in range(len(q.of))],
            "size": [11 if k in signals else 8 for k in range(len(q.of))],
            "color": [CANDIDATE if k in signals else MEASURED for k in range(len(q.of))],
            "line": {"width": 0.6, "color": EDGE},
            "opacity": 1,
        },
    }
    traces = [*_drift(q, start, end, factor), *_allowed(q, start, end, factor), dots]
    x = {"type": "date", "range": _dates([start - 0.03 * (end - start), end + 0.03 * (end - start)])}
    more = {"xaxis": x, "dragmode": "zoom", "margin": MARGIN, **_named(q, factor)}
    return figure(traces, "", labelled(q.name, unit), f"life {q.name}", **more)


def told(q: Quantity, each: Calibration, signals: bool) -> str:
    """What a calibration tells when it is pointed at."""
    value = each.values[q.name]
    lines = [f"{each.day}: {measured(value.value, value.std)} {spelt(q.unit)}", f"{each.data}, rig {each.rig}"]
    lines += ["beyond the limits of a control chart"] if signals else []
    lines += [each.expired] if each.expired else []
    return "<br>".join([*lines, "click: its model"])


def _ends(q: Quantity, days: Sequence[float]) -> tuple[float, float]:
    """First and last day of the picture: some way ahead, and until the next calibration is due."""
    first, last = days[0], days[-1]
    end = last + AHEAD * (last - first)
    if q.due is not None:
        end = max(end, datetime(q.due.year, q.due.month, q.due.day, tzinfo=UTC).timestamp() / DAY_S)
    return (first, end) if end - first > 1 else (first - ALONE_DAYS, last + ALONE_DAYS)


def _drift(q: Quantity, start: float, end: float, factor: float) -> Iterator[Trace]:
    if q.line is None:
        return
    days = np.linspace(max(start, q.line.t_days[0]), end, POINTS)
    value, std = q.line.predict(days)
    reach, x = q.line.coverage * std, _dates(days.tolist())
    yield {**BAND, "x": x, "y": (factor * (value - reach)).tolist()}
    yield {**BAND, "x": x, "y": (factor * (value + reach)).tolist(), "fill": "tonexty", "fillcolor": f"{MODEL}40"}
    line = {"color": MODEL, "width": 1.6}
    yield {
        "type": "scatter",
        "mode": "lines",
        "x": x,
        "y": (factor * value).tolist(),
        "line": line,
        "hoverinfo": "skip",
    }


def _allowed(q: Quantity, start: float, end: float, factor: float) -> Iterator[Trace]:
    """The limits, as broken lines."""
    for bound in q.allowed or ():
        line = {"color": CANDIDATE, "width": 1.4, "dash": "dash"}
        ends = {"x": _dates([start, end]), "y": [factor * bound] * 2}
        yield {"type": "scatter", "mode": "lines", "line": line, "hoverinfo": "skip", **ends}


def _named(q: Quantity, factor: float) -> dict[str, object]:
    """The day on which the next calibration is due, as a line, and what the lines are, beside them."""
    plain = {"showarrow": False, "xref": "paper", "x": 0.01, "xanchor": "left"}
    places = (("lowest allowed", "bottom"), ("highest allowed", "top"))
    names = [{**plain, "y": factor * bound, "yanchor": anchor, "text": text}
             for bound, (text, anchor) in zip(q.allowed or (), places, strict=False)]  # fmt: skip
    if q.due is None:
        return {"annotations": names}
    at = {"type": "line", "layer": "below", "x0": str(q.due), "x1": str(q.due), "yref": "paper", "y0": 0, "y1": 1}
    due = {"x": str(q.due), "yref": "paper", "y": 1, "xanchor": "right", "yanchor": "bottom", "showarrow": False}
    names.append({**due, "text": f"due {q.due}"})
    return {"annotations": names, "shapes": [{**at, "line": {"color": CANDIDATE, "width": 1.6}}]}


def _dates(days: Sequence[float]) -> list[str]:
    """Days since 1970 as Plotly reads times."""
    return [datetime.fromtimestamp(day * DAY_S, tz=UTC).strftime("%Y-%m-%d %H:%M:%S") for day in days]
