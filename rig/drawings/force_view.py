"""What a still sensor feels along each of its axes, as bars from -1 g to +1 g."""

from __future__ import annotations

from collections.abc import Iterator

from rig.drawings import svg
from rig.drawings.attitude import Attitude

ROW_PX, NAME_PX, VALUE_PX = 22, 24, 74


def force_view(attitude: Attitude, corner: tuple[float, float], width: float) -> Iterator[str]:
    """Three bars below `corner`, the upper left one."""
    left, half = corner[0] + NAME_PX, (width - NAME_PX - VALUE_PX) / 2
    middle = left + half
    bottom = corner[1] + 3 * ROW_PX
    for x, words in ((left, "-1 g"), (middle, "0"), (left + 2 * half, "+1 g")):
        yield svg.line([(x, corner[1]), (x, bottom)], svg.FAINT, 1.0)
        yield svg.text((x, bottom + 10), words, 10, svg.QUIET)
    colours = (svg.RED, svg.GREEN, svg.BLUE)
    for k, (name, value, colour) in enumerate(zip("xyz", attitude.specific_force_g, colours, strict=True)):
        y = corner[1] + (k + 0.5) * ROW_PX
        ends = sorted((middle, middle + value * half))
        yield svg.polygon([(ends[0], y - 6), (ends[1], y - 6), (ends[1], y + 6), (ends[0], y + 6)], colour)
        yield svg.line([(middle, y - 8), (middle, y + 8)], svg.INK, 1.2)
        yield svg.text((corner[0] + 8, y), name, 13, colour, bold=True)
        yield svg.text((left + 2 * half + VALUE_PX - 4, y), f"{value:+.3f} g", 12, anchor="end")
