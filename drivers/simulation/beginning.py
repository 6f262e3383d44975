"""The world at time 0: both stages at motor angle 0, the sensor powered for a while, slow noise in full swing."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from drivers.simulation import gravity, heat, state
from drivers.simulation.config import WorldConfig


def beginning(config: WorldConfig, random: np.random.Generator) -> Any:
    """A state record; `random` draws where the random processes stand."""
    world = state.blank()
    world["powered"] = 1
    world["powered_ns"] = -round(1e9 * config.heat.powered_for_s)
    world["up"] = gravity.vertical(config.base)
    mount(world, config, 0.0, 0)
    world["seat"] = 0.5
    world["kept"] = 1.0
    world["flicker_v"] = config.noise.flicker_v * random.standard_normal(world["flicker_v"].shape)
    world["slow_v"] = world["flicker_v"].sum(axis=1)
    world["white"] = random.standard_normal(2)
    world["supply_wander_v"] = config.supply.wander_v * random.standard_normal()
    world["supply_v"] = config.supply.nominal_v + world["supply_wander_v"]
    _warm(world, config.heat, random.standard_normal())
    return world


def mount(world: Any, config: WorldConfig, mount_deg: float, flip: int) -> None:
    """Put the sensor on the table."""
    world["mount_deg"], world["flip"] = mount_deg, flip
    world["mount"] = gravity.mounting(config.sensor.package, mount_deg, flip)


def _warm(world: Any, settings: heat.Heat, normal: float) -> None:
    world["wander_k"] = settings.ambient_wander_k * normal
    world["chamber_c"] = world["body_c"] = world["oven_set_c"] = settings.ambient_c + world["wander_k"]
    world["board_k"] = settings.board_rise_k * (1 - math.exp(-settings.powered_for_s / settings.board_rise_s))
    world["package_k"] = settings.package_rise_k * (1 - math.exp(-settings.powered_for_s / settings.package_rise_s))
    world["thermocouple_c"] = world["body_c"] + world["board_k"] + settings.thermocouple_offset_k
    world["glue_c"] = world["body_c"] + world["board_k"] + world["package_k"]
