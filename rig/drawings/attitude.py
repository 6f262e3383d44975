"""The attitude of the sensor: angles of both stages, turn on the table, face up or down; directions of its axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from procedures.questions import Mounting, Question

Vectors = NDArray[np.float64]


@dataclass(frozen=True)
class Attitude:
    """Angles in deg; `flip` is 1 for face down; `shaken` where the nano-positioner is between table and sensor.

    Lab frame: x to the right, y away from the viewer, z upward.
    """

    alpha_deg: float = 0.0
    beta_deg: float = 0.0
    mount_deg: float = 0.0
    flip: int = 0
    shaken: bool = False

    @property
    def tilted(self) -> Vectors:
        """The axes that alpha turns, as rows in the lab frame, shape (3, 3): the last is the table's normal."""
        c, s = _cos_sin(self.alpha_deg)
        return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])

    @property
    def table(self) -> Vectors:
        """The axes of beta's table, as rows in the lab frame."""
        return _about_z(self.beta_deg) @ self.tilted

    @property
    def sensor(self) -> Vectors:
        """The sensor's axes, as rows in the lab frame: F Rz(mount) Rz(beta) Ry(alpha)."""
        face = np.diag([1.0, -1.0, -1.0]) if self.flip else np.eye(3)
        return face @ _about_z(self.mount_deg) @ self.table

    @property
    def specific_force_g(self) -> tuple[float, float, float]:
        """Specific force of a still sensor along x, y, z: the upward direction in its own frame."""
        x, y, z = (float(value) + 0.0 for value in self.sensor[:, 2].round(12))
        return x, y, z

    @property
    def words(self) -> str:
        """In one line."""
        side = "down" if self.flip else "up"
        stages = f"alpha {self.alpha_deg:g} deg, beta {self.beta_deg:g} deg"
        place = "nano-positioner" if self.shaken else "table"
        return f"{stages}, sensor face {side}, turned by {self.mount_deg:g} deg on the {place}"


def _about_z(deg: float) -> Vectors:
    c, s = _cos_sin(deg)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _cos_sin(deg: float) -> tuple[float, float]:
    return float(np.cos(np.radians(deg))), float(np.sin(np.radians(deg)))


# Which drawing belongs to a question: by its mounting, or by the name that it gives.

NAMED = {"face-up": Attitude(), "face-down": Attitude(flip=1), "on-positioner": Attitude(shaken=True)}


def drawing_of(question: Question) -> Attitude | None:
    """How the sensor is to be mounted; None for a question without a drawing, or with one that is not known here.

    A sensor on edge has none: its words say where two of its axes point.
    """
    if isinstance(question, Mounting) and question.up == "z":
        return Attitude(mount_deg=question.mount_deg, flip=question.flip)
    return NAMED.get(question.drawing)
