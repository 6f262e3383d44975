"""Samples as the converter takes them: scans in time order, the channels of a scan in turn."""

from __future__ import annotations

import math

from drivers.simulation import converter, noise
from drivers.simulation.config import WorldConfig
from drivers.simulation.kernel import Floats, Ints, kernel
from drivers.simulation.mechanics import STEP_NS, run_to
from drivers.simulation.state import State

INPUTS = ("vx", "vy", "supply", "thermistor", "ground")
SUPPLY, THERMISTOR = 2, 3

# A 10 kOhm thermistor at the package, below a 10 kOhm resistor on the sensor's supply.
THERMISTOR_B_K = 3950.0
KELVIN = 273.15


@kernel
def sample(
    world: State, config: WorldConfig, channels: Ints, times_ns: Ints, fast: Floats, slow: Floats, volts: Floats
) -> None:
    """Fill `volts` (scans, channels); `fast` holds two normal numbers per sample, `slow` a row per tick."""
    skew_ns = round(1e9 * config.converter.skew_s)
    used = 0
    for i in range(len(times_ns)):
        used += run_to(world, config, times_ns[i], STEP_NS, slow[used:])
        for k in range(len(channels)):
            analog = input_v(world, config, channels[k], times_ns[i] + k * skew_ns, fast[i, k, 0])
            noisy = analog + config.converter.noise_v * fast[i, k, 1]
            volts[i, k] = converter.bowed_v(config.converter, noisy)


@kernel
def input_v(world: State, config: WorldConfig, channel: int, t_ns: int, normal: float) -> float:
    """Voltage at one input, by its place in INPUTS."""
    if channel < SUPPLY:
        return noise.output_v(world, config.noise, channel, t_ns, normal)
    if channel == SUPPLY:
        return world.supply_v * world.powered
    if channel == THERMISTOR:
        return thermistor_v(world.body_c + world.board_k, world.supply_v * world.powered)
    return 0.0


@kernel
def thermistor_v(package_c: float, supply_v: float) -> float:
    """Middle of the thermistor's divider."""
    ratio = math.exp(THERMISTOR_B_K * (1 / (package_c + KELVIN) - 1 / (25.0 + KELVIN)))
    return supply_v * ratio / (1 + ratio)
