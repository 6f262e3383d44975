"""The rig on its bench: alpha tilts, beta turns on it, the sensor lies on beta's table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rig.drawings import svg
from rig.drawings.attitude import Attitude, Vectors

# Convex solids without perspective: the visible faces, shaded, in the order of drawing.

LIGHT = np.array([-0.45, -0.55, 0.70])
AMBIENT = 0.62  # of the brightness, on a face that the light does not meet
ROUND = 48  # faces of a cylinder


@dataclass(frozen=True)
class Camera:
    """The view of the middle of the lab from `direction`; `scale` px for one unit, the middle at `centre`."""

    direction: tuple[float, float, float]
    scale: float
    centre: tuple[float, float]

    @property
    def toward(self) -> Vectors:
        """The unit vector towards the viewer."""
        return np.array(self.direction) / float(np.linalg.norm(self.direction))

    def project(self, points: Vectors) -> Vectors:
        """Points of the lab, shape (n, 3), as px, shape (n, 2)."""
        right_axis = np.cross([0.0, 0.0, 1.0], self.toward)
        right_axis /= np.linalg.norm(right_axis)
        up = np.cross(self.toward, right_axis)
        flat: Vectors = np.atleast_2d(points) @ np.array([right_axis, -up]).T
        return np.array(self.centre) + self.scale * flat


@dataclass(frozen=True)
class Solid:
    """Convex: `faces` are its corners in the lab, each shape (n, 3), anticlockwise as seen from outside."""

    faces: tuple[Vectors, ...]
    colour: str

    def drawn(self, camera: Camera) -> Iterator[str]:
        """The visible faces; those of a convex solid do not overlap."""
        for face in self.faces:
            normal = np.cross(face[1] - face[0], face[2] - face[1])
            normal /= np.linalg.norm(normal)
            if normal @ camera.toward > EDGE_ON:
                fill = shade(self.colour, float(normal @ LIGHT / np.linalg.norm(LIGHT)))
                yield svg.polygon(camera.project(face), fill, fill, 0.6, stroke_linejoin="round")


def box(low: Sequence[float], high: Sequence[float], axes: Vectors, colour: str) -> Solid:
    """From corner `low` to corner `high` in the frame whose axes are the rows of `axes`."""
    a, b = np.array(low), np.array(high)
    faces = []
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        for side, order in ((a, ((0, 0), (0, 1), (1, 1), (1, 0))), (b, ((0, 0), (1, 0), (1, 1), (0, 1)))):
            corners = np.empty((4, 3))
            corners[:, k] = side[k]
            corners[:, i] = [(a, b)[p][i] for p, _ in order]
            corners[:, j] = [(a, b)[q][j] for _, q in order]
            faces.append(corners @ axes)
    return Solid(tuple(faces), colour)


def cylinder(radius: float, low: float, high: float, axis: int, axes: Vectors, colour: str) -> Solid:
    """About axis number `axis` of the frame, from `low` to `high` along it."""
    phi = np.linspace(0, 2 * np.pi, ROUND, endpoint=False)
    ring = np.empty((ROUND, 3))
    ring[:, (axis + 1) % 3], ring[:, (axis + 2) % 3] = radius * np.cos(phi), radius * np.sin(phi)
    bottom, top = ring.copy(), ring.copy()
    bottom[:, axis], top[:, axis] = low, high
    side_faces = [np.array([bottom[k - 1], bottom[k], top[k], top[k - 1]]) for k in range(ROUND)]
    return Solid(tuple(face @ axes for face in (bottom[::-1], *side_faces, top)), colour)


def shade(colour: str, light: float) -> str:
    """A colour under light that meets it at the cosine `light`."""
    brightness = AMBIENT + (1 - AMBIENT) * max(0.0, light)
    parts = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    return "#" + "".join(f"{min(255, round(part * brightness)):02x}" for part in parts)


STEEL, DARK, ALUMINIUM, LIGHT_METAL = "#8b98a6", "#5b6875", "#c3ccd5", "#dde3e9"
BOARD, BOARD_EDGE, PACKAGE = "#2f7d5b", "#1c5b40", "#3a4450"
LAB = np.eye(3)
EDGE_ON = 1e-6  # cosine: a face that is turned away less is seen along its edge, for any rounding
CAMERA_FROM = (0.62, -1.0, 0.62)
AXIS_LENGTH = 0.95
GRAVITY = np.array([[-1.35, -0.9, 0.75], [-1.35, -0.9, -0.15]])  # from, to
BOARD_HALF, PACKAGE_HALF = 0.36, 0.22
POSITIONER_HALF, POSITIONER_HEIGHT = 0.46, 0.26


def rig_view(attitude: Attitude, centre: tuple[float, float], scale: float) -> Iterator[str]:
    """The rig from the front, a little from the right and from above."""
    camera = Camera(CAMERA_FROM, scale, centre)
    faces_us = bool(attitude.tilted[2] @ camera.toward > -EDGE_ON)
    for solid in [*_stand(), *_bracket(attitude, faces_us)]:
        yield from solid.drawn(camera)
    yield _axis_of_alpha(camera)
    stack = _stack(attitude)
    for solid in stack if faces_us else stack[::-1]:
        yield from solid.drawn(camera)
        if faces_us and solid.colour == BOARD:
            yield from _screws(attitude, camera)
    if faces_us and not attitude.flip:
        yield _pin(attitude, camera)
    if not faces_us:
        yield _hidden_outline(attitude, camera)
    yield from _axes(attitude, camera)


def _stand() -> list[Solid]:
    """The fixed parts: base plate, column, drive of alpha behind."""
    return [
        box((-1.15, -0.95, -1.42), (1.15, 1.6, -1.3), LAB, LIGHT_METAL),
        box((-0.42, 1.0, -1.3), (0.42, 1.45, 0.1), LAB, ALUMINIUM),
        cylinder(0.62, 0.98, 1.5, 1, LAB, STEEL),
        cylinder(0.5, 0.86, 0.98, 1, LAB, DARK),
    ]


def _bracket(attitude: Attitude, faces_us: bool) -> list[Solid]:
    """The bracket that alpha tilts and that carries beta, seen from the visible side."""
    back_plate = box((-0.42, 0.74, -0.74), (0.42, 0.86, 0.42), attitude.tilted, ALUMINIUM)
    floor = box((-0.42, -0.5, -0.74), (0.42, 0.74, -0.62), attitude.tilted, ALUMINIUM)
    return [back_plate, floor] if faces_us else [back_plate]


def _stack(attitude: Attitude) -> list[Solid]:
    """The parts on the bracket, from the floor up: drive of beta, its table, the parts between, the sensor."""
    frame, plate, case = _on_table(attitude), BOARD_HALF, PACKAGE_HALF
    foot = foot_of(attitude)
    board_bottom, thin, package = (
        (foot + 0.12, foot + 0.17, foot) if attitude.flip else (foot, foot + 0.05, foot + 0.05)
    )
    board = box((-plate, -plate, board_bottom), (plate, plate, thin), frame, BOARD)
    case_of = box((-case, -case, package), (case, case, package + 0.12), frame, PACKAGE)
    return [
        box((-0.42, -0.5, -0.74), (0.42, 0.74, -0.62), attitude.tilted, ALUMINIUM),
        cylinder(0.52, -0.62, -0.2, 2, attitude.tilted, STEEL),
        cylinder(0.7, -0.2, 0.0, 2, attitude.table, LIGHT_METAL),
        *(_carriage(frame) if attitude.shaken else []),
        *([case_of, board] if attitude.flip else [board, case_of]),
    ]


def _carriage(frame: Vectors) -> list[Solid]:
    """The fibre whose tip looks along x at the carriage, and the nano-positioner."""
    half = POSITIONER_HALF
    return [
        box((-1.0, -0.045, 0.09), (-half - 0.06, 0.045, 0.18), frame, DARK),
        box((-half, -half, 0.0), (half, half, POSITIONER_HEIGHT), frame, STEEL),
    ]


def foot_of(attitude: Attitude) -> float:
    """How high above the table the sensor begins."""
    return POSITIONER_HEIGHT if attitude.shaken else 0.0


def _on_table(attitude: Attitude) -> Vectors:
    """The sensor's x and y, and the table's normal: a frame in which up is away from the table, face up or down."""
    return Attitude(attitude.alpha_deg, attitude.beta_deg, attitude.mount_deg).sensor


def _screws(attitude: Attitude, camera: Camera) -> Iterator[str]:
    """The marks of the board, at its corners."""
    high, place = foot_of(attitude) + (0.17 if attitude.flip else 0.05), 0.82 * BOARD_HALF
    corners = np.array([[x, y, high] for x in (-place, place) for y in (-place, place)])
    for at in camera.project(corners @ _on_table(attitude)):
        yield svg.circle(at, 0.025 * camera.scale, "#e8edf2", "none", 0)


def _pin(attitude: Attitude, camera: Camera) -> str:
    """The mark of pin 1 on the package."""
    at = camera.project(np.array([-0.13, 0.13, foot_of(attitude) + 0.17]) @ _on_table(attitude))[0]
    return svg.circle(at, 0.035 * camera.scale, "#f7c948", "none", 0)


def _hidden_outline(attitude: Attitude, camera: Camera) -> str:
    """The outline of a board that the table hides."""
    h, foot = BOARD_HALF, foot_of(attitude)
    corners = np.array([[-h, -h, foot], [h, -h, foot], [h, h, foot], [-h, h, foot], [-h, -h, foot]])
    return svg.line(camera.project(corners @ _on_table(attitude)), BOARD_EDGE, 1.4, stroke_dasharray="4 3")


def _axis_of_alpha(camera: Camera) -> str:
    """The axis that alpha turns about, dash-dotted as on a drawing."""
    ends = camera.project(np.array([[0, -1.85, 0], [0, 1.9, 0]], float))
    return svg.line(ends, svg.QUIET, 1.0, stroke_dasharray="12 4 2 4") + svg.text(
        (ends[0][0] - 8, ends[0][1] + 13), "axis of alpha", 12, svg.QUIET
    )


def _axes(attitude: Attitude, camera: Camera) -> Iterator[str]:
    """The sensor's axes, and gravity."""
    middle = foot_of(attitude) * attitude.table[2]
    for axis, name, colour in zip(attitude.sensor, "xyz", (svg.RED, svg.GREEN, svg.BLUE), strict=True):
        start, end, label = camera.project(middle + np.outer([0, AXIS_LENGTH, 1.14 * AXIS_LENGTH], axis))
        yield svg.arrow(start, end, colour) + svg.text(label, name, 14, colour, bold=True)
    top, bottom = camera.project(GRAVITY)
    yield svg.arrow(top, bottom, svg.INK, 2.6) + svg.text((bottom[0], bottom[1] + 13), "gravity", 12)
