"""The map of where the model fails: over both stage angles, or over the direction that gravity came from."""

from __future__ import annotations

from typing import Any

import numpy as np

from calibrations.pictures.columns import columns, specific_force
from calibrations.table import Array
from rig.web.figures.rows import Shown
from rig.web.figures.style import EDGE, SIGNED, Figure, Trace, figure, scale

PALE = 3.0  # times the noise floor: below, noise alone stays pale
APART = 0.22  # of the step between inclinations, by which both directions of turning are set apart
SYMBOLS = {1: "triangle-up", -1: "triangle-down", 0: "circle"}
TOWARDS = "towards x; left: z upwards, right: downwards"


def failure(shown: Shown) -> Figure:
    """Each row where it was, coloured by its residual over the noise floor."""
    x, y, labels, layout = _map(shown)
    over = shown.residual / shown.floor
    reach = max(PALE, float(np.abs(over).max(initial=0.0)))
    side = np.sign(shown.fit.table.optional("direction", 0.0))[shown.rows]
    dots: Trace = {
        "type": "scatter",
        "mode": "markers",
        "x": x[shown.rows].tolist(),
        "y": y[shown.rows].tolist(),
        "customdata": list(range(len(shown.rows))),
        "text": shown.hover,
        "hovertemplate": "%{text}<extra></extra>",
        "marker": {
            "symbol": [SYMBOLS[int(s)] for s in side],
            "size": 10,
            "color": over.tolist(),
            "colorscale": SIGNED,
            "cmin": -reach,
            "cmax": reach,
            "line": {"width": 0.6, "color": EDGE},
            "colorbar": scale("residual / floor"),
        },
    }
    return figure([dots], labels[0], labels[1], "map", **layout)


def _map(shown: Shown) -> tuple[Array, Array, tuple[str, str], dict[str, Any]]:
    """Where each row lies, the axes' labels, and what else the layout needs."""
    fit = shown.fit
    if fit.table.kind == "poses":
        alpha, side = fit.table.column("alpha_deg"), np.sign(fit.table.optional("direction", 0.0))
        steps = np.diff(np.unique(alpha))
        apart = APART * float(np.median(steps)) if len(steps) else 1.0
        labels = ("β (deg); ▲ turning clockwise, ▼ anticlockwise", "α (deg)")
        return fit.table.column("beta_deg"), alpha + apart * side, labels, {"xaxis": {"dtick": 90}}
    if fit.table.kind == "positions":
        a = specific_force(fit)
        flat = a[:, :2] / np.sqrt(np.linalg.norm(a, axis=1, keepdims=True) + np.abs(a[:, 2:]))
        square = {"yaxis": {"scaleanchor": "x"}, "xaxis": {"showticklabels": False}}
        return flat[:, 0] + np.where(a[:, 2] < 0, 2.3, 0.0), flat[:, 1], (TOWARDS, "towards y"), square
    first = columns(fit)[0]
    return (
        first.values[shown.c],
        fit.residual[shown.c] / fit.noise.floor[shown.c],
        (
            first.labels[shown.c],
            "residual / noise floor",
        ),
        {},
    )
