"""A digital level on the turntable: how the surface of its liquid stands to the plate that it lies on.

The liquid is at right angles to the specific force, so an axis shows by how much its positive end is the higher one:
atan2(a_x, a_z) and atan2(a_y, a_z). Upside down that is more than 90 deg.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from drivers.simulation.gravity import felt_g
from drivers.simulation.kernel import Floats

ON_THE_PLATE = np.eye(3)


@dataclass(frozen=True)
class Level:
    """The level's own faults."""

    offset_x_deg: float = 0.0  # what it shows on a level plate
    offset_y_deg: float = 0.0
    noise_deg: float = 0.003  # rms of one reading


def inclination_deg(up: Floats, alpha_rad: float, beta_rad: float) -> tuple[float, float]:
    """True inclination of the plate's x and y axis, in deg: the vertical in the base, the stages' true angles."""
    x, y, z = felt_g(up, ON_THE_PLATE, alpha_rad, beta_rad)
    return math.degrees(math.atan2(x, z)), math.degrees(math.atan2(y, z))


def shown_deg(level: Level, inclined_deg: tuple[float, float], seed: int, t_ns: int) -> tuple[float, float]:
    """What the level makes of it. Its noise hangs on seed and time alone, so looking at it disturbs nothing."""
    noise = level.noise_deg * np.random.default_rng([seed, 3, t_ns]).standard_normal(2)
    x, y = inclined_deg
    return float(x + level.offset_x_deg + noise[0]), float(y + level.offset_y_deg + noise[1])
