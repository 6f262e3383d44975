"""Heat: the room, the oven, and the sensor's own warmth, advanced in ticks.

room (ramp, cycle, wander) + heater -> chamber -> sensor's body -> + board (hours) -> + package (minutes) = die
The thermocouple sits on the package's outside: it feels body and board, not the die.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.world.kernel import follow_lag, kernel, step_wander


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


@dataclass
class Warmth:
    """The present temperatures, C; the rise by the sensor's own heat, K; the state of the oven's controller."""

    wander_k: float = 0.0  # of the room
    chamber_c: float = 0.0
    body_c: float = 0.0
    board_k: float = 0.0  # self-heating
    package_k: float = 0.0  # self-heating
    glue_c: float = 0.0  # the temperature that the package stress follows
    thermocouple_c: float = 0.0
    oven_set_c: float = 0.0
    oven_running: int = 0
    oven_integral: float = 0.0


@kernel
def ambient_c(heat: Heat, t_s: float, wander_k: float) -> float:
    """Room temperature."""
    cycle = heat.ambient_cycle_k * math.sin(2 * math.pi * t_s / heat.ambient_cycle_s)
    return heat.ambient_c + heat.ambient_ramp_k_per_h * t_s / 3600 + cycle + wander_k


@kernel
def heater_power(warmth: Warmth, oven: Oven, step_s: float) -> float:
    """Power of the heater, 0 to 1; the integral waits while the heater is at a limit."""
    if warmth.oven_running == 0:
        warmth.oven_integral = 0.0
        return 0.0
    error = warmth.oven_set_c - warmth.thermocouple_c
    power = oven.gain_per_k * error + warmth.oven_integral
    if 0 <= power <= 1:
        warmth.oven_integral += oven.gain_per_k * error * step_s / oven.integral_s
    return min(max(power, 0.0), 1.0)


@kernel
def tick(warmth: Warmth, heat: Heat, oven: Oven, powered: int, t_s: float, step_s: float, normal: float) -> None:
    """Advance all temperatures by one tick that ends at `t_s`, during which the sensor was `powered` or not."""
    warmth.wander_k = step_wander(warmth.wander_k, heat.ambient_wander_k, heat.ambient_wander_s, step_s, normal)
    heated = ambient_c(heat, t_s, warmth.wander_k) + oven.heater_k * heater_power(warmth, oven, step_s)
    warmth.chamber_c = follow_lag(warmth.chamber_c, heated, step_s, heat.chamber_lag_s)
    warmth.body_c = follow_lag(warmth.body_c, warmth.chamber_c, step_s, heat.body_lag_s)
    warmth.board_k = follow_lag(warmth.board_k, powered * heat.board_rise_k, step_s, heat.board_rise_s)
    warmth.package_k = follow_lag(warmth.package_k, powered * heat.package_rise_k, step_s, heat.package_rise_s)
    case_c = warmth.body_c + warmth.board_k + heat.thermocouple_offset_k
    warmth.thermocouple_c = follow_lag(warmth.thermocouple_c, case_c, step_s, heat.thermocouple_lag_s)
    warmth.glue_c = min(max(warmth.glue_c, die_c(warmth) - heat.glue_play_k / 2), die_c(warmth) + heat.glue_play_k / 2)


@kernel
def die_c(warmth: Warmth) -> float:
    """Temperature of the silicon."""
    return warmth.body_c + warmth.board_k + warmth.package_k
