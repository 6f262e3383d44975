"""What turns with the table beside the accelerometer: a magnetometer and a gyroscope on one board.

Angular rate of the board in its own frame: the table's, that of its inclination, and the earth's. Vectors of the base
go Ry(alpha), then Rz(beta); so a table whose angle grows turns the other way about its own normal.
"""

from __future__ import annotations

import math

from drivers.simulation import gravity, gyroscope, magnetometer, stage
from drivers.simulation.config import WorldConfig
from drivers.simulation.kernel import kernel
from drivers.simulation.state import State


@kernel
def update(world: State, config: WorldConfig, t_ns: int, warmer_k: float) -> None:
    """From where the tables stand at `t_ns` to the volts of both sensors, without noise."""
    alpha = stage.true_angle_rad(config.stages.alpha, world.table_deg[0])
    beta = stage.true_angle_rad(config.stages.beta, world.table_deg[1])
    fx, fy, fz = gravity.felt_g(world.field_ut, world.board, alpha, beta)
    magnetometer.read_v(config.magnetometer, world.plates, fx, fy, fz, warmer_k, world.field_v)
    lx, ly, lz = gravity.felt_g(world.up, world.board, alpha, beta)
    rx, ry, rz = rate_deg_s(world, alpha, beta, t_ns)
    rate, load = gravity.across(world.die, rx, ry, rz), gravity.across(world.die, lx, ly, lz)
    gyroscope.read_v(config.gyroscope, rate, load, warmer_k, world.rate_v)


@kernel
def rate_deg_s(world: State, alpha: float, beta: float, t_ns: int) -> tuple[float, float, float]:
    """Angular rate of the board in its own frame, deg/s, as the mean since the last step."""
    x, y, z = gravity.felt_g(world.earth_deg_s, world.board, alpha, beta)
    if t_ns > world.turned_ns:
        per_s = 1e9 / (t_ns - world.turned_ns)
        leaning = math.degrees(alpha - world.turned_rad[0]) * per_s
        turning = math.degrees(beta - world.turned_rad[1]) * per_s
        sb, cb = math.sin(beta), math.cos(beta)
        own_x, own_y, own_z = gravity.across(world.board, -leaning * sb, leaning * cb, turning)
        x, y, z = x - own_x, y - own_y, z - own_z
    world.turned_rad[0], world.turned_rad[1], world.turned_ns = alpha, beta, t_ns
    return x, y, z
