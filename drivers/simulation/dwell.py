"""Means over dwells without samples: the same mechanics, and the noise that a mean has.

The slow processes are run tick by tick as ever; only the white noise of the samples is replaced by one
number with the distribution that the mean of the filtered, converted and rounded samples has.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drivers.simulation.converter import Converter, bowed_mean_v
from drivers.simulation.kernel import kernel
from drivers.simulation.mechanics import next_event_ns, run_to
from drivers.simulation.noise import Noise, hum_mean_v

Array = NDArray[np.float64]
STEP_NS = 25_000_000  # of the mechanics while a stage turns: half a degree at 20 deg/s
COLUMNS = 6  # of `hold`: x, y without noise; slow noise of x, y; thermocouple; supply


@dataclass(frozen=True)
class Poses:
    """Poses in the order of the visit: motor angles, direction of beta, mount; arrays of one length."""

    alpha_deg: Array
    beta_deg: Array
    direction: NDArray[np.int64]
    mount_deg: Array
    flip: NDArray[np.int64]


@dataclass(frozen=True)
class Timing:
    """How poses are visited: alpha moves, then beta, then the rig settles, then it dwells."""

    dwell_s: float = 5.0
    interval_s: float = 1e-3  # between samples
    settle_s: float = 0.5
    speed_deg_s: float = 20.0
    acceleration_deg_s2: float = 40.0

    @property
    def samples(self) -> int:
        return max(1, round(self.dwell_s / self.interval_s))


def poses(
    alpha_deg: ArrayLike, beta_deg: ArrayLike, direction: ArrayLike | None, mount_deg: ArrayLike, flip: ArrayLike
) -> Poses:
    """Poses from arrays or scalars; the direction follows from the path unless it is given."""
    alpha, beta, mount = (np.asarray(v, dtype=np.float64) for v in (alpha_deg, beta_deg, mount_deg))
    alpha, beta, mount, face = np.broadcast_arrays(np.atleast_1d(alpha), beta, mount, np.asarray(flip, dtype=np.int64))
    way = _path_direction(beta) if direction is None else np.asarray(direction, dtype=np.int64)
    return Poses(alpha, beta, np.broadcast_to(way, alpha.shape), mount, face)


def _path_direction(beta_deg: Array) -> NDArray[np.int64]:
    """Sign of the move of beta to each pose; where beta stood, that of the move after it."""
    way = np.sign(np.diff(beta_deg, prepend=beta_deg[:1])).astype(np.int64)
    following = np.append(way[1:], 0)
    return np.where(way == 0, following, way)


@kernel
def hold(world: Any, config: Any, start_ns: int, end_ns: int, step_ns: int, normals: Any, sums: Any) -> None:
    """Run to `start_ns`, then fill `sums` (COLUMNS,) with means over the dwell that ends at `end_ns`."""
    used = run_to(world, config, start_ns, step_ns, normals)
    sums[:] = 0.0
    t_ns = start_ns
    while t_ns < end_ns:
        after_ns = min(next_event_ns(world, step_ns), end_ns)
        share = (after_ns - t_ns) / (end_ns - start_ns)
        for axis in range(2):
            sums[axis] += share * world.volts[axis]
            sums[2 + axis] += share * world.slow_v[axis]
        sums[4] += share * world.thermocouple_c
        sums[5] += share * world.supply_v * world.powered
        used += run_to(world, config, after_ns, step_ns, normals[used:])
        t_ns = after_ns


def columns(
    visited: Poses,
    means: Array,
    middle_s: Array,
    powered_s: Array,
    noise: Noise,
    converter: Converter,
    timing: Timing,
    random: np.random.Generator | None,
) -> dict[str, NDArray[Any]]:
    """The columns of a table of poses; without a generator, the means are free of noise."""
    count = len(means)
    normals = np.zeros((5, count)) if random is None else random.standard_normal((5, count))
    free = random is None
    variance = 0.0 if free else sample_variance(noise, converter)
    mean_std, std_std = (0.0, 0.0) if free else spreads(noise, converter, timing)
    table: dict[str, NDArray[Any]] = {"alpha_deg": visited.alpha_deg, "beta_deg": visited.beta_deg}
    hum = 0.0 if free else hum_mean_v(noise, middle_s, timing.interval_s, timing.samples)
    for axis, name in enumerate("xy"):
        slow = 0.0 if free else means[:, 2 + axis]
        table[f"v{name}_v"] = bowed_mean_v(converter, means[:, axis] + slow + hum + mean_std * normals[axis], variance)
        table[f"v{name}_std_v"] = np.sqrt(max(0.0, variance - mean_std**2)) * (1 + std_std * normals[2 + axis])
    supply_std = 0.0 if free else math.sqrt(_converter_variance(converter) / timing.samples)
    return table | {
        "t_s": powered_s,
        "direction": visited.direction,
        "temperature_c": means[:, 4],
        "supply_v": means[:, 5] + supply_std * normals[4],
        "mount_deg": visited.mount_deg,
        "flip": visited.flip,
        "n": np.full(count, timing.samples),
    }


def sample_variance(noise: Noise, converter: Converter) -> float:
    """Variance of single samples in V^2: filtered noise, hum, converter, rounding to codes."""
    return noise.white_v**2 + noise.hum_v**2 / 2 + _converter_variance(converter)


def _converter_variance(converter: Converter) -> float:
    return converter.noise_v**2 + converter.step_v**2 / 12


def spreads(noise: Noise, converter: Converter, timing: Timing) -> tuple[float, float]:
    """Standard deviation of a dwell's mean in V; relative one of a dwell's sample standard deviation.

    Neighbouring samples behind the filter correlate by rho: exact sum for the mean of n of them, and
    n (1 - rho^2) / (1 + rho^2) independent ones for the spread.
    """
    n, rho = timing.samples, math.exp(-timing.interval_s / (noise.filter_ohm * noise.filter_farad))
    pairs = n * (1 + rho) / (1 - rho) - 2 * rho * (1 - rho**n) / (1 - rho) ** 2
    mean_variance = noise.white_v**2 * pairs / n**2 + _converter_variance(converter) / n
    return math.sqrt(mean_variance), math.sqrt((1 + rho**2) / (1 - rho**2) / (2 * n))
