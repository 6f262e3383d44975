"""Onto beta's table, at a right angle: how far it is turned, and how the sensor is mounted on it."""

from __future__ import annotations

from collections.abc import Iterator

from rig.drawings import svg
from rig.drawings.attitude import Attitude
from rig.drawings.dial import dial, marked_angle
from rig.drawings.rig_view import BOARD, BOARD_EDGE, PACKAGE

AXIS = 0.74  # length of the sensor's axes, of the radius
BOARD_HALF, PACKAGE_HALF = 0.27, 0.16  # of the radius


def table_view(attitude: Attitude, centre: tuple[float, float], radius: float) -> Iterator[str]:
    """The dial of beta, clockwise for growing beta; the table with its zero mark; the sensor with pin 1 and axes."""
    yield from dial(centre, radius, clockwise=True)
    yield svg.circle(centre, 0.92 * radius, "#eef1f4", "#b8c2cc", 1.0)
    yield from marked_angle(centre, radius, attitude.beta_deg, clockwise=True, inner=0.98)
    sensor_deg = -(attitude.beta_deg + attitude.mount_deg)  # of the sensor's x axis, anticlockwise from the right
    yield svg.turned(centre, sensor_deg, _sensor(attitude, radius))
    yield from _mount(attitude, centre, radius)
    yield from _axes(attitude, centre, radius, sensor_deg)


def _sensor(attitude: Attitude, radius: float) -> Iterator[str]:
    """Board and package with x to the right, about the origin; of one that lies face down the back is seen."""
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
    tip = svg.on_circle(centre, 0.90 * radius, mark_deg)
    yield svg.head(tip, [t - c for t, c in zip(tip, centre, strict=True)], svg.ORANGE)
    if abs(attitude.mount_deg) < 1:
        return
    points = svg.arc(centre, 0.5 * radius, mark_deg, mark_deg - attitude.mount_deg)
    way = [b - a for a, b in zip(points[-2], points[-1], strict=True)]
    yield svg.line([centre, svg.on_circle(centre, 0.86 * radius, mark_deg)], svg.QUIET, 1.0, stroke_dasharray="3 3")
    yield svg.line(points, svg.QUIET, 1.8) + svg.head(points[-1], way, svg.QUIET)


def _axes(attitude: Attitude, centre: tuple[float, float], radius: float, x_deg: float) -> Iterator[str]:
    """x and y in the plane of the table; face down, y is on the other side of x."""
    y_deg = x_deg + (-90 if attitude.flip else 90)
    for name, deg, colour in (("x", x_deg, svg.RED), ("y", y_deg, svg.GREEN)):
        yield svg.arrow(centre, svg.on_circle(centre, AXIS * radius, deg), colour)
        yield svg.text(svg.on_circle(centre, (AXIS + 0.09) * radius, deg), name, 13, colour, bold=True)
