"""A still record over time: means of its samples, less the mean of all."""

from __future__ import annotations

import numpy as np

from calibrations.numerals import plain
from calibrations.still.record import Channel
from rig.web.figures.sensed import Scaled
from rig.web.figures.series import in_time
from rig.web.figures.style import MEASURED, Figure, Trace, figure

MOST = 2000  # points: more cannot be told apart across a page


def record(channel: Channel, into: Scaled) -> Figure:
    """Where the output wandered, jumped or followed something."""
    together = max(1, -(-len(channel.means) // MOST))
    whole = len(channel.means) // together * together
    values = into.factor * channel.means[:whole].reshape(-1, together).mean(axis=1)
    each_s = together * channel.size / channel.rate_hz
    size, unit = in_time(channel.length_s)
    line: Trace = {
        "type": "scatter",
        "mode": "lines",
        "x": ((np.arange(len(values)) + 0.5) * each_s / size).tolist(),
        "y": values.tolist(),
        "line": {"width": 1, "color": MEASURED},
        "hovertemplate": f"%{{y:.4g}} {into.unit} at %{{x:.4g}} {unit}<extra></extra>",
    }
    label = f"{channel.axis} less its mean ({into.unit})"
    keep = f"record {channel.axis} {into.unit}"
    return figure([line], f"time ({unit}); means of {plain(each_s, 2)} s", label, keep, dragmode="zoom")
