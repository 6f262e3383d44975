"""The whole drawing: the rig, alpha from the front, the table of beta, and the specific force on the sensor."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

from rig.drawings import svg
from rig.drawings.attitude import Attitude
from rig.drawings.rig_view import BOARD, BOARD_EDGE, PACKAGE, rig_view

WIDTH, HEIGHT = 960, 640
STRIP_WIDTH, STRIP_HEIGHT = 820, 300


def page(attitude: Attitude) -> str:
    """One SVG file, headed by the attitude in words."""
    return svg.document(WIDTH, HEIGHT, attitude.words, _content(attitude))


@lru_cache(maxsize=8)
def strip(attitude: Attitude) -> str:
    """The three views side by side, for a page: legible at the width of a tablet."""
    return svg.document(STRIP_WIDTH, STRIP_HEIGHT, attitude.words, _side_by_side(attitude))


def _side_by_side(attitude: Attitude) -> Iterator[str]:
    yield svg.text((16, 20), attitude.words, 17, anchor="start", bold=True)
    yield from rig_view(attitude, (148, 158), 72)
    yield svg.text((390, 54), f"Alpha {attitude.alpha_deg:g}°, from the front", 14, svg.QUIET, bold=True)
    yield from front_view(attitude, (390, 172), 80)
    turned = f"Beta {attitude.beta_deg:g}°, sensor turned by {attitude.mount_deg:g}°"
    yield svg.text((660, 54), turned, 14, svg.QUIET, bold=True)
    yield from table_view(attitude, (660, 172), 88)
    yield svg.text((660, 290), _marks(attitude), 13, svg.QUIET)


def _marks(attitude: Attitude) -> str:
    """The meaning of the marks on the sensor."""
    side = "face down: the package is below its board" if attitude.flip else "face up"
    between = "; grey: nano-positioner and fibre" if attitude.shaken else ""
    return f"yellow: pin 1; {side}{between}"


def _content(attitude: Attitude) -> Iterator[str]:
    yield svg.text((32, 38), attitude.words, 18, anchor="start", bold=True)
    yield from rig_view(attitude, (285, 265), 128)
    yield _heading((32, 536), "At rest the sensor feels")
    yield from force_view(attitude, (32, 552), 420)
    yield _heading((600, 100), f"Alpha {attitude.alpha_deg:g}°, from the front")
    yield from front_view(attitude, (735, 222), 88)
    yield _heading((600, 346), f"Beta {attitude.beta_deg:g}°, sensor turned by {attitude.mount_deg:g}°")
    yield from table_view(attitude, (735, 484), 106)
    yield svg.text((735, 624), _marks(attitude), 12, svg.QUIET)


def _heading(at: tuple[float, float], words: str) -> str:
    return svg.text(at, words, 13, svg.QUIET, "start", bold=True)


# A divided circle, and an angle marked on it.


EVERY_DEG, NAMED_EVERY_DEG = 10, 90


def dial(centre: tuple[float, float], radius: float, clockwise: bool) -> Iterator[str]:
    """Divisions from the right; the quarters carry their angle in deg."""
    yield svg.circle(centre, radius, "#fafbfc", svg.FAINT, 1.0)
    for deg in range(0, 360, EVERY_DEG):
        length = 8 if deg % 30 == 0 else 4
        ends = [svg.circle_point(centre, r, deg) for r in (radius - length, radius)]
        yield svg.line(ends, svg.QUIET if length == 8 else "#b8c2cc", 1.0)
    for deg in range(0, 360, NAMED_EVERY_DEG):
        signed_deg = deg if deg <= 180 else deg - 360
        at = svg.circle_point(centre, radius + 13, -deg if clockwise else deg)
        yield svg.text(at, str(signed_deg), 12, svg.QUIET)


def mark_angle(
    centre: tuple[float, float], radius: float, deg: float, clockwise: bool, inner: float = 0.84
) -> Iterator[str]:
    """From zero to `deg`: a line at each end, and an arc between."""
    sign = -1 if clockwise else 1
    text_deg = sign * (deg if abs(deg) <= 360 else deg % 360)
    yield svg.line([centre, svg.circle_point(centre, radius, 0)], svg.QUIET, 1.0, stroke_dasharray="3 3")
    yield svg.line([centre, svg.circle_point(centre, radius, text_deg)], svg.ORANGE, 1.4)
    if abs(text_deg) > 1:
        points = svg.arc(centre, inner * radius, 0, text_deg)
        direction = [b - a for a, b in zip(points[-2], points[-1], strict=True)]
        yield svg.line(points, svg.ORANGE, 1.8) + svg.head(points[-1], direction, svg.ORANGE)


# The specific force along each axis of a still sensor, as bars from -1 g to +1 g.

ROW_PX, NAME_PX, VALUE_PX = 22, 24, 74


def force_view(attitude: Attitude, corner: tuple[float, float], width: float) -> Iterator[str]:
    """Three bars below `corner`, the upper left one."""
    left_px, half = corner[0] + NAME_PX, (width - NAME_PX - VALUE_PX) / 2
    middle = left_px + half
    bottom = corner[1] + 3 * ROW_PX
    for x, words in ((left_px, "-1 g"), (middle, "0"), (left_px + 2 * half, "+1 g")):
        yield svg.line([(x, corner[1]), (x, bottom)], svg.FAINT, 1.0)
        yield svg.text((x, bottom + 10), words, 10, svg.QUIET)
    colours = (svg.RED, svg.GREEN, svg.BLUE)
    for k, (name, value, colour) in enumerate(zip("xyz", attitude.specific_force_g, colours, strict=True)):
        y = corner[1] + (k + 0.5) * ROW_PX
        ends = sorted((middle, middle + value * half))
        yield svg.polygon([(ends[0], y - 6), (ends[1], y - 6), (ends[1], y + 6), (ends[0], y + 6)], colour)
        yield svg.line([(middle, y - 8), (middle, y + 8)], svg.INK, 1.2)
        yield svg.text((corner[0] + 8, y), name, 13, colour, bold=True)
        yield svg.text((left_px + 2 * half + VALUE_PX - 4, y), f"{value:+.3f} g", 12, anchor="end")


# Along the axis of alpha: how far the table is tilted, and which face of the sensor is up.


def front_view(attitude: Attitude, centre: tuple[float, float], radius: float) -> Iterator[str]:
    """The dial of alpha with the table edge-on: anticlockwise for growing alpha, from the horizontal."""
    yield from dial(centre, radius, clockwise=False)
    yield from mark_angle(centre, radius, attitude.alpha_deg, clockwise=False)
    yield svg.rotate(centre, attitude.alpha_deg, _edge_on(attitude, radius))
    yield svg.circle(centre, 3.0, svg.PAPER, svg.INK, 1.4)
    top = (centre[0] + radius + 34, centre[1] - 26)
    yield svg.arrow(top, (top[0], top[1] + 46), svg.INK) + svg.text((top[0], top[1] + 60), "gravity", 12)


def _edge_on(attitude: Attitude, radius: float) -> Iterator[str]:
    """Drive, table, board and package at alpha = 0, about the origin."""
    unit = radius / 100
    yield _block(-34, 34, 16, 44, "#8b98a6", unit)
    yield _block(-66, 66, 0, 16, "#dde3e9", unit, svg.QUIET)
    foot = -18 if attitude.shaken else 0
    package, board = ((0, -9), (-9, -14)) if attitude.flip else ((-5, -15), (0, -5))
    if attitude.shaken:
        yield _block(-42, 42, foot, 0, "#8b98a6", unit)
    yield _block(-20, 20, foot + package[1], foot + package[0], PACKAGE, unit)
    yield _block(-34, 34, foot + board[1], foot + board[0], BOARD, unit)


def _block(
    left_px: float, right_px: float, top: float, bottom: float, fill: str, unit: float, stroke: str = "none"
) -> str:
    corners = [(left_px, top), (right_px, top), (right_px, bottom), (left_px, bottom)]
    return svg.polygon([(unit * x, unit * y) for x, y in corners], fill, stroke, 0.8)


# Onto beta's table, at a right angle: how far it is turned, and how the sensor is mounted on it.

AXIS = 0.74  # length of the sensor's axes, of the radius
BOARD_HALF, PACKAGE_HALF = 0.27, 0.16  # of the radius


def table_view(attitude: Attitude, centre: tuple[float, float], radius: float) -> Iterator[str]:
    """The dial of beta, clockwise for growing beta; the table with its zero mark; the sensor with pin 1 and axes."""
    yield from dial(centre, radius, clockwise=True)
    yield svg.circle(centre, 0.92 * radius, "#eef1f4", "#b8c2cc", 1.0)
    yield from mark_angle(centre, radius, attitude.beta_deg, clockwise=True, inner=0.98)
    sensor_deg = -(attitude.beta_deg + attitude.mount_deg)  # of the sensor's x axis, anticlockwise from the right
    yield svg.rotate(centre, sensor_deg, _sensor(attitude, radius))
    yield from _mount(attitude, centre, radius)
    yield from _axes(attitude, centre, radius, sensor_deg)


def _sensor(attitude: Attitude, radius: float) -> Iterator[str]:
    """Board and package with x to the right, about the origin; face down, the back is visible."""
    b, p = BOARD_HALF * radius, PACKAGE_HALF * radius
    if attitude.shaken:
        yield svg.polygon(_square(1.3 * b), "#c3ccd5", "#8b98a6", 1.2)
        yield svg.polygon([(-0.86 * radius, -4), (-1.4 * b, -4), (-1.4 * b, 4), (-0.86 * radius, 4)], "#5b6875")
    yield svg.polygon(_square(b), BOARD, BOARD_EDGE, 1.2)
    for x, y in _square(0.82 * b):
        yield svg.circle((x, y), 0.022 * radius, "#e8edf2", "none", 0)
    if attitude.flip:
        yield svg.polygon(_square(p), "none", "#d5e8df", 1.2, stroke_dasharray="4 3")
        yield svg.circle((-0.62 * p, 0.62 * p), 0.035 * radius, "none", "#f7c948", 1.4)
    else:
        yield svg.polygon(_square(p), PACKAGE, "#20272e", 1.0)
        yield svg.circle((-0.62 * p, -0.62 * p), 0.035 * radius, "#f7c948", "none", 0)


def _square(half: float) -> list[tuple[float, float]]:
    return [(-half, -half), (half, -half), (half, half), (-half, half)]


def _mount(attitude: Attitude, centre: tuple[float, float], radius: float) -> Iterator[str]:
    """The table's zero mark, and from it the turn of the sensor, where it has one."""
    mark_deg = -attitude.beta_deg
    tip = svg.circle_point(centre, 0.90 * radius, mark_deg)
    yield svg.head(tip, [t - c for t, c in zip(tip, centre, strict=True)], svg.ORANGE)
    if abs(attitude.mount_deg) < 1:
        return
    points = svg.arc(centre, 0.5 * radius, mark_deg, mark_deg - attitude.mount_deg)
    direction = [b - a for a, b in zip(points[-2], points[-1], strict=True)]
    yield svg.line([centre, svg.circle_point(centre, 0.86 * radius, mark_deg)], svg.QUIET, 1.0, stroke_dasharray="3 3")
    yield svg.line(points, svg.QUIET, 1.8) + svg.head(points[-1], direction, svg.QUIET)


def _axes(attitude: Attitude, centre: tuple[float, float], radius: float, x_deg: float) -> Iterator[str]:
    """x and y in the plane of the table; face down, y is on the other side of x."""
    y_deg = x_deg + (-90 if attitude.flip else 90)
    for name, deg, colour in (("x", x_deg, svg.RED), ("y", y_deg, svg.GREEN)):
        yield svg.arrow(centre, svg.circle_point(centre, AXIS * radius, deg), colour)
        yield svg.text(svg.circle_point(centre, (AXIS + 0.09) * radius, deg), name, 13, colour, bold=True)
