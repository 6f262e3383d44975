"""A motion: output beside model over a few periods, and what is left over one period."""

from __future__ import annotations

from calibrations.pictures.motion import over_a_period, waveform
from rig.web.figures.rows import Shown
from rig.web.figures.style import CANDIDATE, MEASURED, MODEL, Figure, Trace, band, figure


def measurement(shown: Shown) -> Figure:
    """Dots are measured, the line is the model, less its mean."""
    found = waveform(shown.fit, _axis(shown))
    x, factor = found.at.tolist(), shown.factor
    dots: Trace = {"x": x, "y": (factor * found.measured).tolist(), "mode": "markers",
                   "marker": {"color": MEASURED, "size": 5}}  # fmt: skip
    line: Trace = {
        "x": x,
        "y": (factor * found.model).tolist(),
        "mode": "lines",
        "line": {"color": MODEL, "width": 1.4},
    }
    told = {"type": "scatter", "hovertemplate": "%{y:.5g} at %{x:.3f} s<extra></extra>"}
    label = f"{_axis(shown)} less its mean ({shown.unit})"
    return figure([line | told, dots | told], "time (s)", label, f"waveform {_axis(shown)}", dragmode="zoom")


def failure(shown: Shown) -> Figure:
    """The mean residual over the phase of the motion; the grey band is the noise of a mean."""
    found = over_a_period(shown.fit, _axis(shown))
    line: Trace = {
        "type": "scatter",
        "mode": "lines+markers",
        "x": found.phase_deg.tolist(),
        "y": (shown.factor * found.residual).tolist(),
        "line": {"color": CANDIDATE, "width": 1.4},
        "hovertemplate": "%{y:.3g} at %{x:.0f} deg<extra></extra>",
    }
    x, shapes = f"phase of the motion {found.line} (deg)", [band(shown.factor * found.floor)]
    label = f"mean residual of {_axis(shown)} ({shown.unit})"
    return figure([line], x, label, f"phase {_axis(shown)}", xaxis={"dtick": 90}, shapes=shapes, dragmode="zoom")


def _axis(shown: Shown) -> str:
    """Of the channel that is shown: `x` of `x in phase at 10 Hz`."""
    return shown.fit.channels[shown.c].partition(" ")[0]
