"""Noise and the output filter: a resistor and a capacitor per axis.

White noise of the sensor reaches the output through the filter: there it is an Ornstein-Uhlenbeck
process, stepped exactly over any interval. Flicker noise is a sum of such processes, one per decade
of correlation time; with the random walk it advances in ticks. Hum is picked up behind the filter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import Generator

from drivers.simulation.heat import wandered
from drivers.simulation.kernel import Floats, kernel

if TYPE_CHECKING:
    from drivers.simulation.state import State

FLICKER_S = (1.0, 10.0, 100.0, 1e3, 1e4)  # correlation times of flicker noise
DECADES = len(FLICKER_S)


@dataclass(frozen=True)
class Noise:
    """Amplitudes at the output, in V."""

    white_v: float = 0.775e-3  # rms behind the filter
    flicker_v: float = 0.0  # rms of each decade of flicker noise
    walk_v_per_sqrt_h: float = 0.0  # random walk of the output
    hum_v: float = 0.0  # amplitude of a sinusoid picked up by the leads
    hum_hz: float = 50.0
    filter_ohm: float = 32e3
    filter_farad: float = 0.33e-6


@kernel
def tick(world: State, noise: Noise, step_s: float, random: Generator) -> None:
    """Advance flicker noise and random walk of both axes by one tick."""
    for axis in range(2):
        for k in range(DECADES):
            old, time_s = world.flicker_v[axis, k], FLICKER_S[k]
            world.flicker_v[axis, k] = wandered(old, noise.flicker_v, time_s, step_s, random.standard_normal())
    for axis in range(2):
        world.walk_v[axis] += noise.walk_v_per_sqrt_h * math.sqrt(step_s / 3600) * random.standard_normal()
        world.slow_v[axis] = world.flicker_v[axis].sum() + world.walk_v[axis]


@kernel
def remember(world: State, noise: Noise, gap_ns: int) -> None:
    """Work out what the filter keeps over `gap_ns`, unless that was asked last."""
    if gap_ns != world.kept_ns:
        world.kept_ns = gap_ns
        world.kept = math.exp(-1e-9 * gap_ns / (noise.filter_ohm * noise.filter_farad))
        world.fresh = math.sqrt(1 - world.kept * world.kept)


@kernel
def charge(world: State, noise: Noise, axis: int, t_ns: int) -> None:
    """Let the capacitor of one axis follow the voltage that has stood at its input until `t_ns`."""
    gap_ns = t_ns - world.filtered_ns[axis]
    if gap_ns > 0:
        remember(world, noise, gap_ns)
        target = world.volts[axis] + world.slow_v[axis]
        world.filtered_v[axis] = target + world.kept * (world.filtered_v[axis] - target)
        world.filtered_ns[axis] = t_ns


@kernel
def output_v(world: State, noise: Noise, axis: int, t_ns: int, normal: float) -> float:
    """What the capacitor of one axis holds at `t_ns`, noise included."""
    charge(world, noise, axis, t_ns)
    gap_ns = t_ns - world.white_ns[axis]
    if gap_ns > 0:
        remember(world, noise, gap_ns)
        world.white[axis] = world.kept * world.white[axis] + world.fresh * normal
        world.white_ns[axis] = t_ns
    volts: float = world.filtered_v[axis] + noise.white_v * world.white[axis] + hum_v(noise, t_ns)
    return volts


@kernel
def hum_v(noise: Noise, t_ns: int) -> float:
    """Pick-up of the leads."""
    if noise.hum_v == 0:
        return 0.0
    return noise.hum_v * math.sin(2 * math.pi * noise.hum_hz * 1e-9 * t_ns)


def hum_mean_v(noise: Noise, middle_s: Floats, interval_s: float, n: int) -> Floats:
    """Mean of the hum over `n` samples around each time of `middle_s`."""
    phase = math.pi * noise.hum_hz * interval_s
    share = 1.0 if math.sin(phase) == 0 else math.sin(n * phase) / (n * math.sin(phase))
    mean: Floats = noise.hum_v * share * np.sin(2 * math.pi * noise.hum_hz * middle_s)
    return mean
