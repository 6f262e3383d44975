"""The whole drawing: the rig as it stands, alpha from the front, the table of beta, and what the sensor feels."""

from __future__ import annotations

from collections.abc import Iterator

from rig.drawings import svg
from rig.drawings.attitude import Attitude
from rig.drawings.rig_view import rig_view
from rig.drawings.views import force_view, front_view, table_view

WIDTH, HEIGHT = 960, 640


def page(attitude: Attitude) -> str:
    """One SVG file, headed by the attitude in words."""
    return svg.document(WIDTH, HEIGHT, attitude.words, _content(attitude))


def _content(attitude: Attitude) -> Iterator[str]:
    yield svg.text((32, 38), attitude.words, 18, anchor="start", bold=True)
    yield from rig_view(attitude, (285, 265), 128)
    yield _heading((32, 536), "At rest the sensor feels")
    yield from force_view(attitude, (32, 552), 420)
    yield _heading((600, 100), f"Alpha {attitude.alpha_deg:g}°, from the front")
    yield from front_view(attitude, (735, 222), 88)
    yield _heading((600, 346), f"Beta {attitude.beta_deg:g}°, sensor turned by {attitude.mount_deg:g}°")
    yield from table_view(attitude, (735, 484), 106)
    side = "face down: the package is below its board" if attitude.flip else "face up"
    between = "; grey: nano-positioner and fibre" if attitude.shaken else ""
    yield svg.text((735, 624), f"yellow: pin 1; {side}{between}", 12, svg.QUIET)


def _heading(at: tuple[float, float], words: str) -> str:
    return svg.text(at, words, 13, svg.QUIET, "start", bold=True)
