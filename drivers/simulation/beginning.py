"""The world at time 0: both stages at motor angle 0, the sensor powered for a while, slow noise in full swing."""

from __future__ import annotations

import math

import numpy as np

from drivers.simulation import gravity, gyroscope, laboratory, magnetometer, mechanics, noise, pickup
from drivers.simulation.config import WorldConfig
from drivers.simulation.heat import Heat, Warmth
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
    _stir(world, numbers, slow)
    world.supply_wander_v = config.supply.wander_v * room.standard_normal()
    world.supply_v = config.supply.nominal_v + world.supply_wander_v
    world.warmth.wander_k = config.heat.ambient_wander_k * room.standard_normal()
    world.charged = 1 - math.exp(-config.heat.powered_for_s / config.sensor.charging_s)
    _warm_up(world.warmth, config.heat)
    mechanics.update(world, numbers, 0)
    world.x.filtered_v = world.volts[0] + world.x.slow_v
    world.y.filtered_v = world.volts[1] + world.y.slow_v
    return world


def _stir(world: State, numbers: WorldConfig, slow: np.random.Generator) -> None:
    """White noise of both outputs, then what is slow in each, then what each picks up."""
    outputs = (world.x, numbers.noise.x, world.pickup_x), (world.y, numbers.noise.y, world.pickup_y)
    for own, _, _ in outputs:
        own.white = slow.standard_normal()
    for own, settings, _ in outputs:
        noise.begin(own, settings, slow)
    for _, settings, picked_up in outputs:
        pickup.begin(picked_up, settings, numbers.floor, slow)


def _warm_up(warmth: Warmth, heat: Heat) -> None:
    """The temperatures after the time for which the sensor has been powered, in a steady room."""
    warmth.chamber_c = warmth.body_c = warmth.oven_set_c = heat.ambient_c + warmth.wander_k
    warmth.board_k = heat.board_rise_k * (1 - math.exp(-heat.powered_for_s / heat.board_rise_s))
    warmth.package_k = heat.package_rise_k * (1 - math.exp(-heat.powered_for_s / heat.package_rise_s))
    warmth.thermocouple_c = warmth.body_c + warmth.board_k + heat.thermocouple_offset_k
    warmth.glue_c = warmth.body_c + warmth.board_k + warmth.package_k
