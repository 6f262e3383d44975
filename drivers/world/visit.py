"""A visit of poses: the motions and dwells, and the means of the dwells as in a table, with the noise of such a mean.

The slow processes run tick by tick. One random number replaces the fast noise of the samples; it has the distribution
of the mean of the filtered, converted and rounded samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray

from drivers.world import pickup
from drivers.world.config import WorldConfig
from drivers.world.converter import Converter, bowed_mean_v
from drivers.world.gravity import Package, mounting
from drivers.world.kernel import Floats, Ints, kernel, mean_variance
from drivers.world.mechanics import next_event_ns, run_to
from drivers.world.noise import Noise, filter_s
from drivers.world.pickup import Floor
from drivers.world.stage import Trajectory, at_rest, motion
from drivers.world.state import State

STEP_NS = 25_000_000  # of the mechanics while a stage turns: half a degree at 20 deg/s
# Of a dwell: both outputs without noise; their slow noise, its mean square; effect of the floor; thermocouple; supply
VOLTS, SLOW, SLOW_SQUARE, SHAKEN, THERMOCOUPLE, SUPPLY, MEANS = 0, 2, 4, 6, 8, 9, 10


@dataclass(frozen=True)
class Poses:
    """Poses in the order of the visit: motor angles, direction of beta, mount; arrays of one length."""

    alpha_deg: Floats
    beta_deg: Floats
    direction: Ints
    mount_deg: Floats
    flip: Ints


@dataclass(frozen=True)
class Timing:
    """Timing of the visits: alpha moves, then beta, then the rig settles, then it dwells."""

    dwell_s: float = 5.0
    interval_s: float = 1e-3  # between samples
    settle_s: float = 0.5
    speed_deg_s: float = 20.0
    acceleration_deg_s2: float = 40.0

    @property
    def samples(self) -> int:
        return max(1, round(self.dwell_s / self.interval_s))


@dataclass(frozen=True)
class Plan:
    """The state of the rig at each of n poses."""

    motions: Floats  # (n, 2, pieces, 4) of alpha and beta, see stage
    rest_ns: Ints  # (n, 2) when each stage is at rest
    dwell_ns: Ints  # (n, 2) start and end of the dwell
    mounts: Floats  # (n, 3, 3) package from table


def poses(
    alpha_deg: ArrayLike, beta_deg: ArrayLike, direction: ArrayLike | None, mount_deg: ArrayLike, flip: ArrayLike
) -> Poses:
    """Poses from arrays or scalars; the direction follows from the path unless it is given."""
    alpha, beta, mount = (np.asarray(v, dtype=np.float64) for v in (alpha_deg, beta_deg, mount_deg))
    alpha, beta, mount, face = np.broadcast_arrays(np.atleast_1d(alpha), beta, mount, np.asarray(flip, dtype=np.int64))
    sense = path_direction(beta) if direction is None else np.asarray(direction, dtype=np.int64)
    return Poses(alpha, beta, np.broadcast_to(sense, alpha.shape), mount, face)


def path_direction(beta_deg: Floats) -> Ints:
    """Sign of the move of beta to each pose; where beta stood, that of the move after it."""
    sense = np.sign(np.diff(beta_deg, prepend=beta_deg[:1])).astype(np.int64)
    return np.where(sense == 0, np.append(sense[1:], 0), sense)


def plan(poses: Poses, timing: Timing, package: Package, now_s: float, motors_deg: tuple[float, float]) -> Plan:
    """The visit of all poses from `now_s` on, with the motors at `motors_deg` (alpha, beta)."""
    moves = [at_rest(angle) for angle in motors_deg]
    tables = [motion(move) for move in moves]
    motions, rests, dwells = [], [], []
    for target in zip(poses.alpha_deg.tolist(), poses.beta_deg.tolist(), strict=True):
        for axis, angle in enumerate(target):
            present_deg = moves[axis].target_deg
            if angle != present_deg:
                moves[axis] = Trajectory(now_s, present_deg, angle, timing.speed_deg_s, timing.acceleration_deg_s2)
                tables[axis] = motion(moves[axis])
                now_s = moves[axis].end_s
        start_s = now_s + timing.settle_s
        now_s = start_s + timing.samples * timing.interval_s
        motions.append(tuple(tables))
        rests.append([move.end_s for move in moves])
        dwells.append([start_s, now_s])
    mount = cache(lambda mount_deg, flip: mounting(package, mount_deg, flip))
    mounts = np.array(list(map(mount, poses.mount_deg, poses.flip)))
    return Plan(np.array(motions), _nanoseconds(rests), _nanoseconds(dwells), mounts)


def _nanoseconds(seconds: list[list[float]]) -> Ints:
    return np.rint(1e9 * np.array(seconds)).astype(np.int64)


@kernel
def visit(
    world: State, config: WorldConfig, motions: Floats, rest_ns: Ints, dwell_ns: Ints, mounts: Floats,
    room: Generator, slow: Generator,
) -> Floats:  # fmt: skip
    """Run through a plan; the ticks draw from `room` and `slow`. Means over the dwells, shape (n, MEANS)."""
    means = np.zeros((len(motions), MEANS))
    for i in range(len(means)):
        world.pieces[:] = motions[i]
        world.rest_ns[:] = rest_ns[i]
        world.mount[:] = mounts[i]
        hold(world, config, dwell_ns[i, 0], dwell_ns[i, 1], room, slow, means[i])
    return means


@kernel
def hold(
    world: State, config: WorldConfig, start_ns: int, end_ns: int, room: Generator, slow: Generator, means: Floats
) -> None:
    """Run to a dwell and through it, add up its `means` (MEANS,)."""
    run_to(world, config, start_ns, STEP_NS, room, slow)
    t_ns = start_ns
    while t_ns < end_ns:
        after_ns = min(next_event_ns(world, STEP_NS), end_ns)
        share = (after_ns - t_ns) / (end_ns - start_ns)
        add(world, share, means)
        run_to(world, config, after_ns, STEP_NS, room, slow)
        t_ns = after_ns


@kernel
def add(world: State, share: float, means: Floats) -> None:
    """Add the present, which lasts for `share` of the dwell, to its `means`."""
    means[VOLTS : VOLTS + 2] += share * world.volts
    for axis, slow_v in ((0, world.x.slow_v), (1, world.y.slow_v)):
        means[SLOW + axis] += share * slow_v
        means[SLOW_SQUARE + axis] += share * slow_v * slow_v
    means[SHAKEN] += share * world.pickup_x.shaken_v
    means[SHAKEN + 1] += share * world.pickup_y.shaken_v
    means[THERMOCOUPLE] += share * world.warmth.thermocouple_c
    means[SUPPLY] += share * world.supply_v * world.powered


def columns(
    means: Floats, middle_s: Floats, config: WorldConfig, timing: Timing, random: Any
) -> dict[str, NDArray[Any]]:
    """The measured columns of a table of poses; `random` is a generator, or None for no noise."""
    converter, supply = config.converter, means[:, SUPPLY]
    vx, vx_std = volts(means[:, 0:THERMOCOUPLE:2], middle_s, config.noise.x, config.floor, converter, timing, random)
    vy, vy_std = volts(means[:, 1:THERMOCOUPLE:2], middle_s, config.noise.y, config.floor, converter, timing, random)
    if random is not None:
        std = math.sqrt(_converter_variance(converter) / timing.samples)
        supply = supply + std * random.standard_normal(len(means))
    return {
        "vx_v": vx,
        "vy_v": vy,
        "vx_std_v": vx_std,
        "vy_std_v": vy_std,
        "temperature_c": means[:, THERMOCOUPLE],
        "supply_v": supply,
        "n": np.full(len(means), timing.samples),
    }


def volts(
    means: Floats, middle_s: Floats, noise: Noise, shaking: Floor, converter: Converter, timing: Timing, random: Any
) -> tuple[Floats, Floats]:
    """Mean and sample standard deviation of one output over each dwell; without noise if `random` is None.

    `means` are those of `visit` that belong to the output, shape (n, 4).
    """
    still, slow, square, shaken = means.T
    if random is None:
        return bowed_mean_v(converter, still, 0.0), np.zeros(len(means))
    sinusoids_v, sinusoids_variance = sinusoids(shaken, middle_s, noise, shaking, timing)
    variance = sample_variance(noise, converter, timing) + np.maximum(square - slow**2, 0.0) + sinusoids_variance
    mean_std, relative = spreads(noise, converter, timing)
    mean = still + slow + sinusoids_v + mean_std * random.standard_normal(len(means))
    std = np.sqrt(np.maximum(variance - mean_std**2, 0.0)) * (1 + relative * random.standard_normal(len(means)))
    return bowed_mean_v(converter, mean, variance), np.abs(std)


def sinusoids(
    shaken_v: Floats, middle_s: Floats, noise: Noise, shaking: Floor, timing: Timing
) -> tuple[Floats, Floats]:
    """Mean and variance of the hum, and of the floor's shaking of amplitude `shaken_v`, over each dwell."""
    samples = middle_s, timing.interval_s, timing.samples
    floors = shaking.shaking_hz, pickup.low_pass(shaking, filter_s(noise))[1], *samples
    hums = noise.hum_hz, 0.0, *samples
    mean = noise.hum_v * pickup.sinusoid_mean(*hums) + shaken_v * pickup.sinusoid_mean(*floors)
    square = noise.hum_v**2 * pickup.sinusoid_variance(*hums) + shaken_v**2 * pickup.sinusoid_variance(*floors)
    return np.asarray(mean), np.asarray(square)


def sample_variance(noise: Noise, converter: Converter, timing: Timing) -> float:
    """Variance of single samples in V^2: filtered noise, converter, rounding to codes, random pickup."""
    return noise.white_v**2 + _converter_variance(converter) + pickup.random_variance(noise, timing.interval_s)


def _converter_variance(converter: Converter) -> float:
    return converter.noise_v**2 + converter.step_v**2 / 12


def spreads(noise: Noise, converter: Converter, timing: Timing) -> tuple[float, float]:
    """Standard deviation of a dwell's mean in V; relative one of a dwell's sample standard deviation.

    Neighbouring samples behind the filter correlate by rho: n (1 - rho^2) / (1 + rho^2) of n are independent for the
    spread.
    """
    n, interval_s = timing.samples, timing.interval_s
    rho = math.exp(-interval_s / filter_s(noise))
    white = mean_variance(noise.white_v, filter_s(noise), interval_s, n)
    picked_up = pickup.random_mean_variance(noise, interval_s, n)
    mean_std = math.sqrt(white + _converter_variance(converter) / n + picked_up)
    return mean_std, math.sqrt((1 + rho**2) / (1 - rho**2) / (2 * n))
