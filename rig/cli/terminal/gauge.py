"""A value between its limits, as a bar for a terminal; in words too, for who cannot tell its colour."""

from __future__ import annotations

import math

from rich.text import Text

from rig.runs.observer import nearness

WIDTH = 15  # characters, the ends included
STYLES = {"": "green", "near its limit": "yellow", "beyond its limit": "bold red"}


def gauge(value: float, low: float, high: float) -> Text:
    """`├────────●───┤`: where `value` is from `low` to `high`; beyond them it stands at the end."""
    share = (value - low) / (high - low) if math.isfinite(value) and high > low else 1.0
    place = 1 + round(min(max(share, 0.0), 1.0) * (WIDTH - 3))
    mark = ("●", STYLES[nearness(value, low, high)])
    return Text.assemble(("├" + "─" * (place - 1), "dim"), mark, ("─" * (WIDTH - 2 - place) + "┤", "dim"))
