"""Heat: the room, the oven, and the sensor's own warmth, advanced in ticks.

room (ramp, cycle, wander) + heater -> chamber -> sensor's body -> + board (hours) -> + package (minutes) = die
The thermocouple sits on the package's outside: it feels body and board, not the die.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.simulation.kernel import kernel

if TYPE_CHECKING:
    from drivers.simulation.state import State


@dataclass(frozen=True)
class Heat:
    """Temperatures in C or K, times in s; every lag is of first order, 0 s is no lag."""

    ambient_c: float = 22.0
    ambient_ramp_k_per_h: float = 0.0
    ambient_cycle_k: float = 0.0  # amplitude of a sinusoid that starts at 0
    ambient_cycle_s: float = 86400.0
    ambient_wander_k: float = 0.0  # rms of a slow random wander
    ambient_wander_s: float = 1800.0  # its correlation time
    chamber_lag_s: float = 900.0  # chamber behind room and heater
    body_lag_s: float = 120.0  # sensor behind chamber
    board_rise_k: float = 0.0  # self-heating of the board, final
    board_rise_s: float = 5400.0
    package_rise_k: float = 0.0  # self-heating of the die above the package, final
    package_rise_s: float = 240.0
    glue_play_k: float = 0.0  # full width of the play between temperature and package stress
    powered_for_s: float = 43200.0  # how long the sensor has been powered when the world begins
    thermocouple_lag_s: float = 0.0
    thermocouple_offset_k: float = 0.0


@dataclass(frozen=True)
class Oven:
    """Heater and PI controller of the chamber; the controller's sensor is the thermocouple."""

    heater_k: float = 120.0  # rise of the chamber at full power, final
    gain_per_k: float = 0.1  # power (0 to 1) per K of error
    integral_s: float = 1200.0


@kernel
def lagged(value: float, target: float, step_s: float, lag_s: float) -> float:
    """`value` after following a constant `target` for `step_s`."""
    return target if lag_s <= 0 else target + (value - target) * math.exp(-step_s / lag_s)


@kernel
def ambient_c(heat: Heat, t_s: float, wander_k: float) -> float:
    """Room temperature."""
    cycle = heat.ambient_cycle_k * math.sin(2 * math.pi * t_s / heat.ambient_cycle_s)
    return heat.ambient_c + heat.ambient_ramp_k_per_h * t_s / 3600 + cycle + wander_k


@kernel
def heater_power(world: State, oven: Oven, step_s: float) -> float:
    """Power of the heater, 0 to 1; the integral waits while the heater is at a limit."""
    if world.oven_running == 0:
        world.oven_integral = 0.0
        return 0.0
    error = world.oven_set_c - world.thermocouple_c
    wanted = oven.gain_per_k * error + world.oven_integral
    if 0 <= wanted <= 1:
        world.oven_integral += oven.gain_per_k * error * step_s / oven.integral_s
    return min(max(wanted, 0.0), 1.0)


@kernel
def tick(world: State, heat: Heat, oven: Oven, t_s: float, step_s: float, normal: float) -> None:
    """Advance all temperatures by one tick that ends at `t_s`."""
    world.wander_k = wandered(world.wander_k, heat.ambient_wander_k, heat.ambient_wander_s, step_s, normal)
    heated = ambient_c(heat, t_s, world.wander_k) + oven.heater_k * heater_power(world, oven, step_s)
    world.chamber_c = lagged(world.chamber_c, heated, step_s, heat.chamber_lag_s)
    world.body_c = lagged(world.body_c, world.chamber_c, step_s, heat.body_lag_s)
    world.board_k = lagged(world.board_k, world.powered * heat.board_rise_k, step_s, heat.board_rise_s)
    world.package_k = lagged(world.package_k, world.powered * heat.package_rise_k, step_s, heat.package_rise_s)
    outside = world.body_c + world.board_k + heat.thermocouple_offset_k
    world.thermocouple_c = lagged(world.thermocouple_c, outside, step_s, heat.thermocouple_lag_s)
    world.glue_c = min(max(world.glue_c, die_c(world) - heat.glue_play_k / 2), die_c(world) + heat.glue_play_k / 2)


@kernel
def die_c(world: State) -> float:
    """Temperature of the silicon."""
    return world.body_c + world.board_k + world.package_k


@kernel
def wandered(value: float, rms: float, time_s: float, step_s: float, normal: float) -> float:
    """An Ornstein-Uhlenbeck process, one exact step on: correlation time `time_s`, stationary `rms`."""
    kept = math.exp(-step_s / time_s)
    return kept * value + rms * math.sqrt(1 - kept * kept) * normal
