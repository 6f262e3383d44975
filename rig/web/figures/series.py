"""Values of a run over time: the mean of each part, and between which values its dwells lie."""

from __future__ import annotations

from rig.analysis.course import Course
from rig.web.figures.style import CANDIDATE, MEASURED, Figure, Trace, figure

LENGTHS = ((10800.0, 3600.0, "h"), (300.0, 60.0, "min"), (-1.0, 1.0, "s"))  # longer than, unit, its name
BAND = {"line": {"width": 0}, "hoverinfo": "skip", "type": "scatter", "mode": "lines"}
FEW = 400  # parts: as many can be told apart as dots


def series(course: Course, name: str) -> Figure:
    """One quantity, V or °C, over the time of the run."""
    t_s, mean, low, high = course.line(name)
    length = t_s[-1] - t_s[0] if t_s else 0.0
    size, unit = in_time(length)
    at = [t / size for t in t_s]
    colour = CANDIDATE if name == "temperature" else MEASURED
    label = "temperature (°C)" if name == "temperature" else f"{name} (V)"
    look: Trace = {"mode": "lines+markers" if len(at) < FEW else "lines", "line": {"width": 1.4, "color": colour}}
    told = f"%{{y:.6g}} at %{{x:.4g}} {unit}<extra></extra>"
    line: Trace = {"type": "scatter", "x": at, "y": mean, "marker": {"size": 4}, "hovertemplate": told, **look}
    band = [{**BAND, "x": at, "y": low}, {**BAND, "x": at, "y": high, "fill": "tonexty", "fillcolor": f"{colour}33"}]
    return figure([*(band if course.each > 1 else []), line], f"time ({unit})", label, name, dragmode="zoom")


def in_time(length_s: float) -> tuple[float, str]:
    """(unit in s, its name) that a stretch of time is told in."""
    return next((size, unit) for limit, size, unit in LENGTHS if length_s > limit)
