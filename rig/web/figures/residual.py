"""What the model leaves: the residual against a column, coloured by another; the noise floor; a candidate's curve."""

from __future__ import annotations

from collections.abc import Iterator

from calibrations.discover import Added
from calibrations.pictures.candidate import curves
from calibrations.pictures.columns import Column
from rig.web.figures.rows import Shown
from rig.web.figures.style import CANDIDATE, Figure, Trace, band, coloured, figure


def residual(shown: Shown, x: Column, colour: Column, step: Added | None = None) -> Figure:
    """`step`: an effect whose curve is drawn through the residual, as a function of `x`."""
    c, rows = shown.c, shown.rows
    dots: Trace = {
        "type": "scatter",
        "mode": "markers",
        "x": x.values[c, rows].tolist(),
        "y": shown.residual.tolist(),
        "customdata": list(range(len(rows))),
        "text": shown.hover,
        "hovertemplate": "%{text}<extra></extra>",
        "marker": coloured(colour.values[c, rows].tolist(), colour.labels[c]),
    }
    lines = list(_curves(step, x, shown)) if step else []
    ticks = {"dtick": 90} if x.name == "beta" else {}
    return figure([dots, *lines], x.labels[c], shown.label, f"{x.name} {shown.unit}", xaxis=ticks,
                  shapes=[band(shown.floor)])  # fmt: skip


def _curves(step: Added, x: Column, shown: Shown) -> Iterator[Trace]:
    """What the effect explains, one line for each direction of turning: full clockwise, broken anticlockwise."""
    for side, at, values in curves(step, x, shown.c):
        line = {"type": "scatter", "mode": "lines", "x": at.tolist(), "y": (shown.factor * values).tolist()}
        turning = {1: " clockwise", -1: " anticlockwise"}.get(int(side), "")
        dash = "solid" if side >= 0 else "dash"
        told = f"what {step.name} explains{turning}<extra></extra>"
        yield {**line, "line": {"color": "rgba(255,255,255,0.85)", "width": 6}, "hoverinfo": "skip"}
        yield {**line, "line": {"color": CANDIDATE, "width": 3, "dash": dash}, "hovertemplate": told}
