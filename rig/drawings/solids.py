"""Convex solids seen from far away: their faces that look this way, shaded, in the order in which they are painted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rig.drawings import svg
from rig.drawings.attitude import Vectors

LIGHT = np.array([-0.45, -0.55, 0.70])
AMBIENT = 0.62  # of the brightness, on a face that the light does not meet
ROUND = 48  # faces of a cylinder


@dataclass(frozen=True)
class Camera:
    """Looks at the middle of the lab from `direction`; `scale` px for one unit, the middle at `centre`."""

    direction: tuple[float, float, float]
    scale: float
    centre: tuple[float, float]

    @property
    def toward(self) -> Vectors:
        """The unit vector to who looks."""
        return np.array(self.direction) / float(np.linalg.norm(self.direction))

    def project(self, points: Vectors) -> Vectors:
        """Points of the lab, shape (n, 3), as px, shape (n, 2)."""
        right = np.cross([0.0, 0.0, 1.0], self.toward)
        right /= np.linalg.norm(right)
        up = np.cross(self.toward, right)
        flat: Vectors = np.atleast_2d(points) @ np.array([right, -up]).T
        return np.array(self.centre) + self.scale * flat


@dataclass(frozen=True)
class Solid:
    """Convex: `faces` are its corners in the lab, each shape (n, 3), anticlockwise as seen from outside."""

    faces: tuple[Vectors, ...]
    colour: str

    def drawn(self, camera: Camera) -> Iterator[str]:
        """The faces that can be seen; of a convex solid they do not cover each other."""
        for face in self.faces:
            normal = np.cross(face[1] - face[0], face[2] - face[1])
            normal /= np.linalg.norm(normal)
            if normal @ camera.toward > 1e-6:
                fill = shaded(self.colour, float(normal @ LIGHT / np.linalg.norm(LIGHT)))
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
    around = [np.array([bottom[k - 1], bottom[k], top[k], top[k - 1]]) for k in range(ROUND)]
    return Solid(tuple(face @ axes for face in (bottom[::-1], *around, top)), colour)


def shaded(colour: str, light: float) -> str:
    """A colour under light that meets it at the cosine `light`."""
    brightness = AMBIENT + (1 - AMBIENT) * max(0.0, light)
    parts = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    return "#" + "".join(f"{min(255, round(part * brightness)):02x}" for part in parts)
