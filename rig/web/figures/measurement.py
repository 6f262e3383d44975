"""Measurement beside model: dots are measured, the line is the model."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from calibrations.pictures.columns import Column
from calibrations.pictures.measurement import zero
from calibrations.pictures.view import groups
from calibrations.table import Array
from rig.web.figures.rows import Shown
from rig.web.figures.style import MODEL, Figure, Trace, coloured, figure


def measurement(shown: Shown, x: Column, colour: Column) -> Figure:
    """The output over `x`; the magnitude of what the model makes of it where the orientation is not known."""
    c, rows = shown.c, shown.rows
    measured, model, label = _sides(shown)
    dots: Trace = {
        "type": "scatter",
        "mode": "markers",
        "x": x.values[c, rows].tolist(),
        "y": measured[rows].tolist(),
        "customdata": list(range(len(rows))),
        "text": shown.hover,
        "hovertemplate": "%{y:.6g}<br>%{text}<extra></extra>",
        "marker": coloured(colour.values[c, rows].tolist(), colour.labels[c]),
    }
    at, values = _line(shown, x.values[c], model)
    line = {"type": "scatter", "mode": "lines" if x.name == "beta" else "markers", "x": at, "y": values}
    look = {"line": {"color": MODEL, "width": 1.2}, "marker": {"symbol": "cross-thin-open", "size": 7, "color": MODEL}}
    ticks = {"dtick": 90} if x.name == "beta" else {}
    told = "the model: %{y:.6g}<extra></extra>"
    return figure([dots, {**line, **look, "hovertemplate": told}], x.labels[c], label, f"{x.name} {label}", xaxis=ticks)


def _sides(shown: Shown) -> tuple[Array, Array, str]:
    """What was measured, what the model says, and what both are, for every row."""
    fit, c = shown.fit, shown.c
    if fit.table.kind == "positions":
        what = "|m| (share of the field)" if fit.table.content == "fields" else "|a| (g)"
        return 1.0 + fit.residual[0], np.ones(fit.table.n), what
    measured = fit.table.outputs[:, c]
    model = measured - fit.residual[c]
    if not shown.in_g:
        return measured, model, f"output of {fit.channels[c]} ({fit.table.unit})"
    offset, unit = zero(fit, c), fit.table.input_unit
    label = f"{fit.channels[c]} by bias and scale factor ({unit})"
    return (measured - offset) / shown.scale, (model - offset) / shown.scale, label


def _line(shown: Shown, x: Array, model: Array) -> tuple[list[float | None], list[float | None]]:
    """The model over x, one stretch for each inclination and side, with gaps between."""
    at: list[float | None] = []
    values: list[float | None] = []
    for rows in _stretches(shown):
        order = rows[np.argsort(x[rows], kind="stable")]
        at += [*x[order].tolist(), None]
        values += [*model[order].tolist(), None]
    return at, values


def _stretches(shown: Shown) -> Iterator[NDArray[np.intp]]:
    for group in groups(shown.fit):
        rows = np.intersect1d(group.rows, shown.rows)
        if len(rows):
            yield rows
