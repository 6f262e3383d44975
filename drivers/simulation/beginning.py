"""The world at time 0: both stages at motor angle 0, the sensor powered for a while, slow noise in full swing."""

from __future__ import annotations

import math

import numpy as np

from drivers.simulation import gravity, gyroscope, laboratory, magnetometer, mechanics
from drivers.simulation.config import WorldConfig
from drivers.simulation.heat import Heat
from drivers.simulation.kernel import record
from drivers.simulation.state import State


def beginning(config: WorldConfig, numbers: WorldConfig, room: np.random.Generator, slow: np.random.Generator) -> State:
    """A record of the state; `numbers` is the record of `config`.

    Where slow noise stands is drawn from `room` for what all sensors share, from `slow` for the sensor's own.
    """
    world = record(State())
    world.powered_ns = -round(1e9 * config.heat.powered_for_s)
    world.up = gravity.vertical(config.base)
    world.mount = gravity.mounting(config.sensor.package, 0.0, 0)
    world.board = gravity.mounting(gravity.Package(), 0.0, 0)
    world.earth_deg_s = laboratory.rotation_deg_s(config.laboratory, config.base)
    world.field_ut = laboratory.field_ut(config.laboratory, config.base)
    world.plates, world.die = magnetometer.normals(config.magnetometer), gyroscope.die(config.gyroscope)
    world.white = slow.standard_normal(2)
    world.flicker_v = config.noise.flicker_v * slow.standard_normal(world.flicker_v.shape)
    world.slow_v = world.flicker_v.sum(axis=1)
    world.supply_wander_v = config.supply.wander_v * room.standard_normal()
    world.supply_v = config.supply.nominal_v + world.supply_wander_v
    world.wander_k = config.heat.ambient_wander_k * room.standard_normal()
    world.charged = 1 - math.exp(-config.heat.powered_for_s / config.sensor.charging_s)
    _warm_up(world, config.heat)
    mechanics.update(world, numbers, 0)
    world.filtered_v = world.volts + world.slow_v
    return world


def _warm_up(world: State, heat: Heat) -> None:
    """The temperatures after the time for which the sensor has been powered, in a steady room."""
    world.chamber_c = world.body_c = world.oven_set_c = heat.ambient_c + world.wander_k
    world.board_k = heat.board_rise_k * (1 - math.exp(-heat.powered_for_s / heat.board_rise_s))
    world.package_k = heat.package_rise_k * (1 - math.exp(-heat.powered_for_s / heat.package_rise_s))
    world.thermocouple_c = world.body_c + world.board_k + heat.thermocouple_offset_k
    world.glue_c = world.body_c + world.board_k + world.package_k
