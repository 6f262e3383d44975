"""A divided circle, and an angle marked on it."""

from __future__ import annotations

from collections.abc import Iterator

from rig.drawings import svg

EVERY_DEG, NAMED_EVERY_DEG = 10, 90


def dial(centre: tuple[float, float], radius: float, clockwise: bool) -> Iterator[str]:
    """Divisions from the right; the quarters carry their angle in deg."""
    yield svg.circle(centre, radius, "#fafbfc", svg.FAINT, 1.0)
    for deg in range(0, 360, EVERY_DEG):
        length = 8 if deg % 30 == 0 else 4
        ends = [svg.on_circle(centre, r, deg) for r in (radius - length, radius)]
        yield svg.line(ends, svg.QUIET if length == 8 else "#b8c2cc", 1.0)
    for deg in range(0, 360, NAMED_EVERY_DEG):
        shown = deg if deg <= 180 else deg - 360
        at = svg.on_circle(centre, radius + 13, -deg if clockwise else deg)
        yield svg.text(at, str(shown), 10.5, svg.QUIET)


def marked_angle(
    centre: tuple[float, float], radius: float, deg: float, clockwise: bool, inner: float = 0.84
) -> Iterator[str]:
    """From zero to `deg`: a line at each end, and an arc between."""
    sign = -1 if clockwise else 1
    shown = sign * (deg if abs(deg) <= 360 else deg % 360)
    yield svg.line([centre, svg.on_circle(centre, radius, 0)], svg.QUIET, 1.0, stroke_dasharray="3 3")
    yield svg.line([centre, svg.on_circle(centre, radius, shown)], svg.ORANGE, 1.4)
    if abs(shown) > 1:
        points = svg.arc(centre, inner * radius, 0, shown)
        way = [b - a for a, b in zip(points[-2], points[-1], strict=True)]
        yield svg.line(points, svg.ORANGE, 1.8) + svg.head(points[-1], way, svg.ORANGE)
