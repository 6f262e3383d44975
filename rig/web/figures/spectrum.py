"""The spectrum of a still record beside the model: power over frequency, one-sided, lines taken off."""

from __future__ import annotations

import numpy as np

from calibrations.noise_analysis.freedom import COVERAGE
from calibrations.pictures.noise import root
from calibrations.still.channel_fit import ChannelFit
from calibrations.table import Array
from rig.web.figures.sensed import Scaled
from rig.web.figures.style import CANDIDATE, FLOOR, MEASURED, MODEL, Figure, Trace, decades, figure


def spectrum(found: ChannelFit, into: Scaled, candidate: ChannelFit | None = None) -> Figure:
    """Dots are measured; 95 % of them should be in the grey band by the model, whose density is the line."""
    order = np.argsort(found.frequency_hz)
    f, by = found.frequency_hz[order], into.factor
    low, high = (by * root(each[order]) for each in found.interval(COVERAGE))
    edge = {"line": {"width": 0}, "hoverinfo": "skip"}
    traces = [
        _line(f, low) | edge,
        _line(f, high) | edge | {"fill": "tonexty", "fillcolor": FLOOR},
        _line(f, by * root(found.seen[order])) | {"mode": "markers", "marker": {"color": MEASURED, "size": 4},
                                             "hovertemplate": "%{y:.3g} at %{x:.4g} Hz<extra></extra>"},
        _line(f, by * root(found.expected[order])) | {"line": {"color": MODEL, "width": 1.6}, "hoverinfo": "skip"},
    ]  # fmt: skip
    if candidate is not None:
        there = np.argsort(candidate.frequency_hz)
        density = by * root(candidate.expected[there])
        traces.append(_line(candidate.frequency_hz[there], density) | {"line": {"color": CANDIDATE, "width": 2.6}})
    label = f"density ({into.unit}/√Hz)"
    keep = f"spectrum {found.channel.axis} {into.unit}"
    return figure(traces, "frequency (Hz)", label, keep, **decades(), dragmode="zoom")


def _line(f: Array, values: Array) -> Trace:
    return {"type": "scatter", "mode": "lines", "x": f.tolist(), "y": values.tolist()}
