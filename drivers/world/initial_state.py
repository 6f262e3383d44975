"""The world at time 0: stages at motor angle 0, sensor powered for some time, stationary noise; individuals of rigs."""

from __future__ import annotations

import math
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np

from drivers.world import gravity, laboratory, mechanics, noise, pickup, turned_sensors
from drivers.world.accelerometer import OutOfPlane
from drivers.world.config import SensingAxis, Spread, WorldConfig
from drivers.world.heat import Heat, Warmth
from drivers.world.kernel import record
from drivers.world.state import State


def state_at_start(
    config: WorldConfig, numbers: WorldConfig, room: np.random.Generator, slow: np.random.Generator
) -> State:
    """A record of the state; `numbers` is the record of `config`.

    The values of slow noise are drawn from `room` for all that the sensors share, from `slow` for the sensor's own.
    """
    world = record(State())
    world.powered_ns = -round(1e9 * config.heat.powered_for_s)
    world.up = gravity.vertical(config.base)
    world.mount = gravity.mounting(config.sensor.package, 0.0, 0)
    world.board = gravity.mounting(gravity.Package(), 0.0, 0)
    world.earth_deg_s = laboratory.rotation_deg_s(config.laboratory, config.base)
    world.field_ut = laboratory.field_ut(config.laboratory, config.base)
    world.plates, world.die = turned_sensors.normals(config.magnetometer), turned_sensors.die(config.gyroscope)
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
    """Draw the initial state of both outputs: white noise, slow noise, pickup."""
    outputs = (world.x, numbers.noise.x, world.pickup_x), (world.y, numbers.noise.y, world.pickup_y)
    for fluctuation, _, _ in outputs:
        fluctuation.white = slow.standard_normal()
    for fluctuation, settings, _ in outputs:
        noise.begin(fluctuation, settings, slow)
    for _, settings, picked_up in outputs:
        pickup.begin(picked_up, settings, numbers.floor, slow)


def _warm_up(warmth: Warmth, heat: Heat) -> None:
    """The temperatures after the time for which the sensor has been powered, in a steady room."""
    warmth.chamber_c = warmth.body_c = warmth.oven_set_c = heat.ambient_c + warmth.wander_k
    warmth.board_k = heat.board_rise_k * (1 - math.exp(-heat.powered_for_s / heat.board_rise_s))
    warmth.package_k = heat.package_rise_k * (1 - math.exp(-heat.powered_for_s / heat.package_rise_s))
    warmth.thermocouple_c = warmth.body_c + warmth.board_k + heat.thermocouple_offset_k
    warmth.glue_c = warmth.body_c + warmth.board_k + warmth.package_k


# Every rig differs: an individual is drawn around its settings.

Axis = TypeVar("Axis", SensingAxis, OutOfPlane)
# Fixed by the factory or the design: no imperfections, so without scatter.
EXACT = {"resonance_hz", "sag_resonance_hz", "charging_s", "gap_um", "zero_g_v", "sensitivity_v_per_g", "worm_cycles"}


def individual(config: WorldConfig, seed: int, place: int = 0) -> WorldConfig:
    """One rig drawn from `config.spread`, and the sensor at `place` of its table. Equal seeds give equal results."""
    random = np.random.default_rng([seed, 0])
    trims = random.standard_normal((2, 2))
    fraction = config.spread.imperfection_fraction
    stages, base = (_scatter(part, fraction, random) for part in (config.stages, config.base))
    if place:
        random = np.random.default_rng([seed, 0, place])
        trims = random.standard_normal((2, 2))
    sensor = _scatter(config.sensor, fraction, random)
    axes = (sensor.x, sensor.y, sensor.z)
    x, y, z = (
        _trim(axis, config.spread, *trim) for axis, trim in zip(axes, [*trims, random.standard_normal(2)], strict=True)
    )
    return replace(config, stages=stages, base=base, sensor=replace(sensor, x=x, y=y, z=z))


def _trim(axis: Axis, spread: Spread, zero: float, gain: float) -> Axis:
    plates = replace(
        axis.plates,
        zero_g_v=axis.plates.zero_g_v + spread.zero_g_v * zero,
        sensitivity_v_per_g=axis.plates.sensitivity_v_per_g * (1 + spread.sensitivity_fraction * gain),
    )
    return replace(axis, plates=plates)


def _scatter(settings: Any, fraction: float, random: np.random.Generator) -> Any:
    """Every imperfection times a log-normal number; a number is drawn for absent ones too."""
    new = {}
    for f in fields(settings):
        value = getattr(settings, f.name)
        if is_dataclass(value):
            new[f.name] = _scatter(value, fraction, random)
        elif f.name not in EXACT:
            new[f.name] = value * math.exp(fraction * random.standard_normal())
    return replace(settings, **new)
