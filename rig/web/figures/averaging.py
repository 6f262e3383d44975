"""How much neighbouring means of a still record differ, over the time that each is taken over: beside the model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from calibrations.pictures.noise import COLOURS
from calibrations.pictures.still import OTHER
from calibrations.still.allan import Averaged, deviation, parts
from calibrations.still.channel_fit import ChannelFit
from calibrations.table import Array
from rig.web.figures.sensed import Scaled
from rig.web.figures.style import CANDIDATE, MEASURED, MODEL, Figure, Trace, band, decades, figure

POINTS = 120
STEPS = [a * 10.0**b for b in range(-3, 4) for a in (1, 2, 5)]  # marked along a ratio
TIME = "averaging time (s)"


def allan(found: ChannelFit, curve: Averaged, into: Scaled, candidate: ChannelFit | None = None) -> Figure:
    """Dots are measured, bars intervals of 95 %; a line is the model, thin ones its parts, a thick one a candidate."""
    by = into.factor
    steps = np.geomspace(1, float(curve.tau_s[-1]) * found.channel.rate_hz, POINTS)
    tau_s = np.unique(np.round(steps)).astype(np.float64) / found.channel.rate_hz
    lines = [_line(tau_s, by * deviation(found, tau_s), "the model", MODEL, 1.6)]
    if len(found.effects) + len(found.lines) > 1:
        lines += list(_parts(parts(found, tau_s), tau_s, by))
    if candidate is not None:
        lines.append(_line(tau_s, by * deviation(candidate, tau_s), "with the candidate", CANDIDATE, 2.6))
    label = f"Allan deviation ({into.unit})"
    keep = f"allan {found.channel.axis} {into.unit}"
    return figure([*lines, _measured(curve, by)], TIME, label, keep, **decades(), dragmode="zoom")


def ratio(curve: Averaged, axis: str) -> Figure:
    """Measured over modelled deviation: where the interval leaves 1, the model fails."""
    off = [f"{abs(d):.1f} standard deviations off at {t:.4g} s" for d, t in zip(curve.deviations, curve.tau_s,
                                                                                strict=True)]  # fmt: skip
    above, below = (curve.high - curve.measured) / curve.modelled, (curve.measured - curve.low) / curve.modelled
    dots = _dots(curve.tau_s, curve.ratio, above, below) | {"text": off, "hovertemplate": "%{text}<extra></extra>"}
    y = {"type": "log", "tickvals": STEPS, "ticktext": [f"{step:g}" for step in STEPS]}
    shapes = [{**band(0.0), "type": "line", "y0": 1.0, "y1": 1.0, "line": {"width": 1.4, "color": MODEL}}]
    more = {"xaxis": decades()["xaxis"], "yaxis": y, "shapes": shapes, "dragmode": "zoom"}
    return figure([dots], TIME, "measured / model", f"ratio {axis}", **more)


def _parts(variances: Mapping[str, Array], tau_s: Array, by: float) -> Iterator[Trace]:
    """Thin lines, each with its name where it is the largest share of the whole."""
    whole = sum(variances.values(), np.zeros(len(tau_s)))
    for name, variance in variances.items():
        at, colour = int(np.argmax(variance / whole)), COLOURS.get(name, OTHER)
        place = "top right" if at < len(tau_s) / 2 else "top left"
        text = {"text": [name if k == at else "" for k in range(len(tau_s))], "textposition": place}
        yield _line(tau_s, by * np.sqrt(variance), name, colour, 0.9) | {"mode": "lines+text", **text}


def _measured(curve: Averaged, by: float) -> Trace:
    above, below = curve.high - curve.measured, curve.measured - curve.low
    dots = _dots(curve.tau_s, by * curve.measured, by * above, by * below)
    return dots | {"hovertemplate": "%{y:.3g} at %{x:.4g} s, measured<extra></extra>"}


def _dots(x: Array, y: Array, above: Array, below: Array) -> Trace:
    bars = {"type": "data", "symmetric": False, "array": above.tolist(), "arrayminus": below.tolist(), "width": 0}
    look = {"marker": {"color": MEASURED, "size": 6}, "error_y": {**bars, "thickness": 1}}
    return {"type": "scatter", "mode": "markers", "x": x.tolist(), "y": y.tolist(), **look}


def _line(tau_s: Array, values: Array, name: str, colour: str, width: float) -> Trace:
    look = {"line": {"color": colour, "width": width}, "hovertemplate": f"{name}: %{{y:.3g}}<extra></extra>"}
    return {"type": "scatter", "mode": "lines", "x": tau_s.tolist(), "y": values.tolist(), **look}
