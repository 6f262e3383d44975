"""Samples of the converter: scans in the order of time, the channels of a scan one after the other."""

from __future__ import annotations

import math

import numpy as np
from numpy.random import Generator

from drivers.world import converter, displacement_sensor, noise, positioner
from drivers.world.config import WorldConfig
from drivers.world.kernel import Floats, Ints, kernel
from drivers.world.mechanics import STEP_NS, next_event_ns, out_of_plane_v, run_to
from drivers.world.noise import Fluctuation, Noise
from drivers.world.pickup import Floor, Pickup, with_pickup_v
from drivers.world.state import State

INPUTS = ("vx", "vy", "supply", "thermistor", "ground", "d63", "vz", "mx", "my", "mz", "gx", "gy", "gz")
VX, VY, SUPPLY, THERMISTOR, D63, VZ, FIELD, RATE = 0, 1, 2, 3, 5, 6, 7, 10

# A 10 kOhm thermistor at the package, below a 10 kOhm resistor on the sensor's supply.
THERMISTOR_B_K = 3950.0
KELVIN = 273.15


@kernel
def sample(
    world: State, config: WorldConfig, channels: Ints, late_ns: Ints, times_ns: Ints,
    room: Generator, slow: Generator, fast: Generator, volts: Floats,
) -> None:  # fmt: skip
    """Fill `volts` (scans, channels), each channel `late_ns` after its scan.

    Chance is drawn from `room` and `slow` tick by tick, from `fast` sample by sample.
    """
    count = 0
    while count < len(times_ns):
        run_to(world, config, times_ns[count], STEP_NS, room, slow)
        event_ns, first = next_event_ns(world, STEP_NS), count
        while count < len(times_ns) and times_ns[count] < event_ns:
            count += 1
        convert(world, config, channels, late_ns, times_ns[first:count], fast, volts[first:count])
        world.now_ns = max(times_ns[count - 1], world.now_ns)


@kernel
def convert(
    world: State, config: WorldConfig, channels: Ints, late_ns: Ints, times_ns: Ints, random: Generator, volts: Floats
) -> None:
    """Fill `volts` with scans without an event between them: only filters and noise advance."""
    steady = steady_v(world, config)
    for i in range(len(times_ns)):
        for k in range(len(channels)):
            t_ns = times_ns[i] + late_ns[k]
            if channels[k] == VX:
                analog = output_v(world.x, world.pickup_x, config.noise.x, config.floor, world.volts[0], t_ns, random)
            elif channels[k] == VY:
                analog = output_v(world.y, world.pickup_y, config.noise.y, config.floor, world.volts[1], t_ns, random)
            elif channels[k] == D63:
                analog = displacement_v(world, config, t_ns, random.standard_normal())
            elif channels[k] == VZ:
                analog = steady[VZ] + config.sensor.z.noise_v * random.standard_normal()
            elif channels[k] >= RATE:
                analog = steady[channels[k]] + config.gyroscope.noise_v * random.standard_normal()
            elif channels[k] >= FIELD:
                analog = steady[channels[k]] + config.magnetometer.noise_v * random.standard_normal()
            else:
                analog = steady[channels[k]]
            noisy = analog + config.converter.noise_v * random.standard_normal()
            volts[i, k] = converter.bowed_v(config.converter, noisy)


@kernel
def output_v(
    fluctuation: Fluctuation, picked_up: Pickup, settings: Noise, floor: Floor, volts: float, t_ns: int,
    random: Generator,
) -> float:  # fmt: skip
    """One of the filtered outputs at `t_ns`, with its noise; `volts` at the input of the filter."""
    filtered = noise.output_v(fluctuation, settings, volts, t_ns, random.standard_normal())
    return with_pickup_v(picked_up, settings, floor, filtered, t_ns, random) if picked_up.is_any else filtered


@kernel
def displacement_v(world: State, config: WorldConfig, t_ns: int, normal: float) -> float:
    """Output of the displacement sensor behind the carriage."""
    x_um = world.carriage[0, -1, 1]  # where it ends up
    if t_ns < world.carriage_rest_ns[0]:
        x_um = positioner.motion(config.positioner, world.carriage[0], 1e-9 * t_ns)[0]
    return displacement_sensor.seen_v(config.d63, config.d63.standoff_um + x_um) + config.d63.noise_v * normal


@kernel
def steady_v(world: State, config: WorldConfig) -> Floats:
    """Voltages of INPUTS that change at events only, without noise; 0 for the others."""
    volts = np.zeros(len(INPUTS))
    volts[SUPPLY] = world.supply_v * world.powered
    volts[VZ] = out_of_plane_v(world, config)
    volts[FIELD:RATE] = world.field_v * world.powered
    volts[RATE:] = world.rate_v * world.powered
    volts[THERMISTOR] = thermistor_v(world.warmth.body_c + world.warmth.board_k, volts[SUPPLY])
    return volts


@kernel
def thermistor_v(package_c: float, supply_v: float) -> float:
    """Middle of the thermistor's divider."""
    ratio = math.exp(THERMISTOR_B_K * (1 / (package_c + KELVIN) - 1 / (25.0 + KELVIN)))
    return supply_v * ratio / (1 + ratio)
