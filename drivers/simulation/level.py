"""A digital level on the turntable: how the surface of its liquid stands to the plate that it lies on.

The liquid is at right angles to the specific force, so an axis shows by how much its positive end is the higher one:
atan2(a_x, a_z) and atan2(a_y, a_z). Upside down that is more than 90 deg.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from drivers.simulation import gravity, stage

if TYPE_CHECKING:
    from drivers.simulation.config import WorldConfig
    from drivers.simulation.state import State

ON_THE_PLATE = np.eye(3)


@dataclass(frozen=True)
class Level:
    """The level's own faults."""

    offset_x_deg: float = 0.0  # what it shows on a level plate
    offset_y_deg: float = 0.0
    noise_deg: float = 0.003  # rms of one reading


def inclination_deg(world: State, config: WorldConfig) -> tuple[float, float]:
    """True inclination of the plate's x and y axis, in deg; `config` as the kernels read it."""
    alpha = stage.true_angle_rad(config.stages.alpha, world.table_deg[0])
    beta = stage.true_angle_rad(config.stages.beta, world.table_deg[1])
    x, y, z = gravity.felt_g(world.up, ON_THE_PLATE, alpha, beta)
    return math.degrees(math.atan2(x, z)), math.degrees(math.atan2(y, z))


def shown_deg(world: State, config: WorldConfig, seed: int) -> tuple[float, float]:
    """What the level makes of it. Its noise hangs on seed and time alone, so looking at it disturbs nothing."""
    noise = config.level.noise_deg * np.random.default_rng([seed, 3, int(world.now_ns)]).standard_normal(2)
    x, y = inclination_deg(world, config)
    return float(x + config.level.offset_x_deg + noise[0]), float(y + config.level.offset_y_deg + noise[1])
