"""The few shapes of SVG that the drawings are made of. Coordinates in px, y downward as SVG has it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

INK, QUIET, FAINT, PAPER = "#1f2933", "#616e7c", "#e4e7eb", "#ffffff"
RED, GREEN, BLUE, ORANGE = "#c2410c", "#00795a", "#0b65a0", "#b45309"
FONT = "Helvetica, Arial, 'DejaVu Sans', sans-serif"
HEAD_PX = 9.0  # of an arrow
Point = Sequence[float] | NDArray[np.float64]


def element(name: str, content: str = "", /, **attributes: object) -> str:
    """One element; `stroke_width` stands for `stroke-width`, numbers are rounded to 0.01 px."""
    attribute_text = "".join(f' {key.replace("_", "-")}="{_text(value)}"' for key, value in attributes.items())
    return f"<{name}{attribute_text}>{content}</{name}>" if content else f"<{name}{attribute_text}/>"


def polygon(points: Iterable[Point], fill: str, stroke: str = "none", width: float = 1.0, **attributes: str) -> str:
    """A closed shape."""
    look = {"fill": fill, "stroke": stroke, "stroke_width": width, **attributes}
    return element("polygon", points=_path(points), **look)


def line(points: Iterable[Point], stroke: str = INK, width: float = 1.0, **attributes: str) -> str:
    """An open line."""
    look = {"fill": "none", "stroke": stroke, "stroke_width": width, **attributes}
    return element("polyline", points=_path(points), **look)


def circle(centre: Point, radius: float, fill: str = "none", stroke: str = INK, width: float = 1.0) -> str:
    """A circle."""
    return element("circle", cx=centre[0], cy=centre[1], r=radius, fill=fill, stroke=stroke, stroke_width=width)


def arrow(start: Point, end: Point, colour: str, width: float = 2.2) -> str:
    """An arrow with its head at `end`; a dot if it points at the viewer."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    length = float(np.hypot(*(b - a)))
    if length < HEAD_PX:
        return circle(a, 3.2, PAPER, colour, width) + circle(a, 1.0, colour, colour, 0)
    foot = b - HEAD_PX * (b - a) / length
    return line([a, foot], colour, width, stroke_linecap="round") + head(b, b - a, colour)


def head(tip: Point, towards: Point, colour: str) -> str:
    """The head of an arrow that points along a direction of any length."""
    b, direction = np.asarray(tip, float), np.asarray(towards, float)
    direction = direction / np.hypot(*direction)
    normal = np.array([-direction[1], direction[0]])
    foot = b - HEAD_PX * direction
    return polygon([b, foot + 0.42 * HEAD_PX * normal, foot - 0.42 * HEAD_PX * normal], colour)


def text(
    at: Point, words: str, size: float = 12.0, colour: str = INK, anchor: str = "middle", bold: bool = False
) -> str:
    """One line of words with its middle at the height `at`, on a halo of paper that keeps it legible."""
    words = re.sub(r"(?<!\w)-(?=\d)", "−", words)
    look = {"font_size": size, "fill": colour, "text_anchor": anchor, "font_weight": "600" if bold else "400"}
    halo = {"stroke": PAPER, "stroke_width": 3, "stroke_linejoin": "round", "paint_order": "stroke"}
    return element("text", escape(words), x=at[0], y=at[1] + 0.35 * size, **look, **halo)


def arc(centre: Point, radius: float, from_deg: float, to_deg: float) -> list[tuple[float, float]]:
    """Points on a circle; angles in deg from the right, growing anticlockwise as one sees it."""
    n = max(2, int(abs(to_deg - from_deg) // 3) + 2)
    return [circle_point(centre, radius, float(deg)) for deg in np.linspace(from_deg, to_deg, n)]


def circle_point(centre: Point, radius: float, deg: float) -> tuple[float, float]:
    """The point of a circle at an angle in deg from the right, anticlockwise as one sees it."""
    phi = np.radians(deg)
    return float(centre[0] + radius * np.cos(phi)), float(centre[1] - radius * np.sin(phi))


def rotate(centre: Point, deg: float, content: Iterable[str]) -> str:
    """A drawing about the origin, turned anticlockwise by `deg` about `centre`."""
    return element(
        "g", "".join(content), transform=f"translate({centre[0]:.2f} {centre[1]:.2f}) rotate({0.0 - deg:.4f})"
    )


def document(width: float, height: float, title: str, content: Iterable[str]) -> str:
    """A complete file. `title` is the text for screen readers."""
    space = {"xmlns": "http://www.w3.org/2000/svg", "viewBox": f"0 0 {width:g} {height:g}"}
    paper = element("rect", width=width, height=height, fill=PAPER)
    body = "\n".join([element("title", escape(title)), paper, *content])
    return element("svg", f"\n{body}\n", **space, width=width, height=height, role="img", font_family=FONT) + "\n"


def _path(points: Iterable[Point]) -> str:
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in points)


def _text(value: object) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".") if isinstance(value, float) else escape(str(value))
