"""The orientations of a sensor in a hand: those that it has, those that it lacks, and the next one.

As text, three squares show the sphere of directions from above: its upper part, its equator and its lower part. Each
place is a side, an edge or a corner of the sensor that points upward, or along the magnetic field. As SVG, two discs
show the halves of the sphere, beside the sensor as it rests in the next orientation.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from calibrations.design.orientations import ORIENTATIONS, find_covered
from calibrations.table import AXES, Array
from calibrations.text import typeset
from procedures.session import Guidance
from rig.drawings import svg

TAKEN, LACKING, WANTED = "●", "·", "◎"
UPWARD = ((1, "+z upward"), (0, "z level"), (-1, "-z upward"))
ALONG_FIELD = ((1, "+z with field"), (0, "z across"), (-1, "-z with field"))
ROWS = (1, 0, -1)  # of y, from above
COLUMNS = (-1, 0, 1)  # of x, from the left


def orientation_map(guidance: Guidance) -> list[str]:
    """The map in five lines, with a legend."""
    marks = _marks(guidance)
    layers = ALONG_FIELD if guidance.north else UPWARD
    heads = "   ".join(f"{name:<13}" for _, name in layers)
    lines = [f"     {heads}"]
    for y in ROWS:
        squares = ("  ".join(marks.get((x, y, z), " ") for x in COLUMNS) for z, _ in layers)
        lines.append(f"{('+y', '  ', '-y')[1 - y]}   {'   '.join(f'{square:<13}' for square in squares)}".rstrip())
    lines.append("   " + "   ".join(f"{'-x':<5}{'+x':<8}" for _ in layers).rstrip())
    return [*lines, f"{_covered(marks)}   {WANTED} next   {LACKING} not yet"]


def _covered(marks: dict[tuple[int, int, int], str]) -> str:
    """The mark and number of directions near which there is a position."""
    return f"{TAKEN} covered ({sum(mark == TAKEN for mark in marks.values())} of {len(marks)} directions)"


# The same as SVG.

WIDTH, HEIGHT = 820, 300
CUBE, CUBE_PX = (150, 180), 50.0
ARROW_START = (78, 62)  # of the cube: where the arrow to the north begins
DISCS = (((430, 164), 1, "+z half"), ((680, 164), -1, "-z half"))
DISC_PX = 88.0
VIEW = np.array([0.5, -0.7, 0.6])  # from the sensor to the viewer; z is upward
SIDES = {"x": "#f6d5c6", "y": "#c6e5d9", "z": "#c9dff0"}


def orientation_drawing(guidance: Guidance) -> str:
    """The sensor in the next orientation, and the halves of the sphere, as SVG."""
    return svg.document(WIDTH, HEIGHT, typeset(guidance.text), _content(guidance))


def _content(guidance: Guidance) -> Iterator[str]:
    action, _, progress = typeset(guidance.text).partition("; ")
    yield svg.text((16, 20), action, 16, anchor="start", bold=True)
    yield svg.text((16, 42), progress, 14, svg.QUIET, anchor="start")
    if guidance.moves:
        yield from _resting_cube(np.array(guidance.up), np.array(guidance.north))
    marks = _marks(guidance)
    for centre, half, name in DISCS:
        yield svg.text((centre[0] - 92, 66), name.replace("-", "−"), 14, svg.QUIET, bold=True)
        yield from _disc(centre, half, marks)
    of = "field: " if guidance.north else ""
    yield svg.text((555, 287), f"{of}{_covered(marks)}   {WANTED} next   ○ not yet", 13, svg.QUIET)


def _disc(centre: tuple[int, int], half: int, marks: dict[tuple[int, int, int], str]) -> Iterator[str]:
    """Half of the sphere, by equal areas; x points to the right and y upward on the page."""
    yield svg.circle(centre, DISC_PX, "#fafbfc", svg.FAINT)
    for name, (x, y) in {"+x": (1, 0), "−x": (-1, 0), "+y": (0, 1), "−y": (0, -1)}.items():
        yield svg.text((centre[0] + 1.2 * DISC_PX * x, centre[1] - 1.17 * DISC_PX * y), name, 12, svg.QUIET)
    for signs, mark in marks.items():
        up = np.array(signs) / np.linalg.norm(signs)
        if half * up[2] < 0:
            continue
        flat = up[:2] / np.sqrt(1 + abs(up[2])) * DISC_PX
        at = (centre[0] + float(flat[0]), centre[1] - float(flat[1]))
        if mark == WANTED:
            yield svg.circle(at, 10.0, "none", svg.ORANGE, 2.5) + svg.circle(at, 4.0, svg.ORANGE, svg.ORANGE)
        else:
            yield svg.circle(
                at, 6.5, svg.GREEN if mark == TAKEN else svg.PAPER, svg.GREEN if mark == TAKEN else svg.QUIET
            )


def _resting_cube(up: Array, north: Array) -> Iterator[str]:
    """The sensor as a cube with names on its sides, turned so that `up` points upward, and `north` away, if given."""
    turn = np.array([np.cross(north, up), north, up]) if len(north) else _turn_upward(up)
    right = np.cross([0.0, 0.0, 1.0], VIEW) / np.hypot(VIEW[0], VIEW[1])
    above = np.cross(VIEW, right) / np.linalg.norm(VIEW)

    def projected(place: Array) -> tuple[float, float]:
        x, y = float(right @ turn @ place), float(above @ turn @ place)
        return CUBE[0] + CUBE_PX * x, CUBE[1] - CUBE_PX * y

    for k, axis in enumerate(AXES):
        for sign in (1.0, -1.0):
            normal = sign * np.eye(3)[k]
            if VIEW @ turn @ normal <= 1e-9:
                continue
            first, second = np.eye(3)[(k + 1) % 3], np.eye(3)[(k + 2) % 3]
            corners = [normal + a * first + b * second for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
            yield svg.polygon([projected(corner) for corner in corners], SIDES[axis], svg.INK, 1.2)
            yield svg.text(projected(normal), f"{'+' if sign > 0 else '−'}{axis}", 15, bold=True)
    if len(north):
        middle, ahead = projected(np.zeros(3)), projected(1.1 * north)
        start = CUBE[0] + ARROW_START[0], CUBE[1] + ARROW_START[1]
        end = start[0] + ahead[0] - middle[0], start[1] + ahead[1] - middle[1]
        yield svg.arrow(start, end, svg.BLUE)
        yield svg.text((end[0] + 6, end[1] + 4), "north", 13, svg.BLUE, "start", bold=True)
    x, y = projected(np.sign(np.round(up, 6)))
    yield svg.arrow((x, y), (x, y - 44), svg.ORANGE)
    yield svg.text((x + 9, y - 40), "up", 13, svg.ORANGE, "start", bold=True)


def _turn_upward(up: Array) -> Array:
    """The smallest turn of `up` to +z, as a matrix."""
    x, y, z = up
    if z < -1 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    cross = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1 + z))


def _marks(guidance: Guidance) -> dict[tuple[int, int, int], str]:
    """The mark of each orientation by the signs of its three parts."""
    is_taken = find_covered(np.array(guidance.taken).reshape(-1, 3))
    nearest = ORIENTATIONS[np.argmax(ORIENTATIONS @ np.array(guidance.target))]
    wanted = tuple(int(part) for part in np.sign(np.round(nearest, 6)))
    marks = {}
    for up, is_covered in zip(ORIENTATIONS, is_taken, strict=True):
        x, y, z = (int(part) for part in np.sign(np.round(up, 6)))
        marks[x, y, z] = TAKEN if is_covered else LACKING
        if guidance.moves and (x, y, z) == wanted:
            marks[x, y, z] = WANTED
    return marks
