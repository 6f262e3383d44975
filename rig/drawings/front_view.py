"""Along the axis of alpha: how far the table is tilted, and which face of the sensor is up."""

from __future__ import annotations

from collections.abc import Iterator

from rig.drawings import svg
from rig.drawings.attitude import Attitude
from rig.drawings.dial import dial, marked_angle
from rig.drawings.rig_view import BOARD, PACKAGE


def front_view(attitude: Attitude, centre: tuple[float, float], radius: float) -> Iterator[str]:
    """The dial of alpha with the table edge-on: anticlockwise for growing alpha, from the horizontal."""
    yield from dial(centre, radius, clockwise=False)
    yield from marked_angle(centre, radius, attitude.alpha_deg, clockwise=False)
    yield svg.turned(centre, attitude.alpha_deg, _edge_on(attitude, radius))
    yield svg.circle(centre, 3.0, svg.PAPER, svg.INK, 1.4)
    top = (centre[0] + radius + 34, centre[1] - 26)
    yield svg.arrow(top, (top[0], top[1] + 46), svg.INK) + svg.text((top[0], top[1] + 60), "gravity", 11)


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


def _block(left: float, right: float, top: float, bottom: float, fill: str, unit: float, stroke: str = "none") -> str:
    corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
    return svg.polygon([(unit * x, unit * y) for x, y in corners], fill, stroke, 0.8)
