"""Rigs with one hidden defect, for tests of the diagnosis: a sweep's table from the simulated world.

The rig is ideal but for the spread of bias and scale factor, white noise, a room whose temperature
cycles by a few K, and the defect. The defect's size is chosen so that its noise-free change of both
voltages, after the best straight line V = b + s a per axis, has an rms of so many times the noise of
one dwell's mean.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.world import visit
from drivers.world.config import WorldConfig
from drivers.world.visit import Timing
from drivers.world.world import World
from tests.hidden.defects import DEFECTS, UNEXPLAINED, Defect

Table = dict[str, NDArray[Any]]

INCLINATIONS_DEG = (90.0, 30.0, 150.0, 60.0, 120.0, 45.0, 135.0)
ROOM = {"ambient_cycle_k": 2.5, "ambient_cycle_s": 2300.0, "ambient_ramp_k_per_h": 1.0, "chamber_lag_s": 60.0}
IDEAL = WorldConfig.ideal().changed({"heat": ROOM})


def sweep() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Inclination, beta, direction: 7 inclinations x 37 positions x both ways, 518 poses."""
    up = np.arange(0.0, 361.0, 10.0)
    beta = np.tile(np.concatenate([up, up[::-1]]), len(INCLINATIONS_DEG))
    direction = np.tile(np.repeat([1, -1], len(up)), len(INCLINATIONS_DEG))
    return np.repeat(INCLINATIONS_DEG, 2 * len(up)), beta, direction


def noise_floor_v(config: WorldConfig = IDEAL) -> float:
    """Standard deviation of one dwell's mean."""
    return visit.spreads(config.noise.x, config.converter, Timing())[0]


def clean_rig(seed: int) -> Table:
    """A sweep on a rig without a defect."""
    return swept(IDEAL, seed)


def rig_with(defect_name: str, times_noise: float, seed: int) -> Table:
    """A sweep on a rig with a defect of DEFECTS."""
    return _defective(DEFECTS[defect_name], times_noise, seed)


def unexplained_rig(name: str, times_noise: float, seed: int) -> Table:
    """A sweep on a rig with a defect of UNEXPLAINED, which no good sensor's law describes."""
    return _defective(UNEXPLAINED[name], times_noise, seed)


def scaled(defect: Defect, config: WorldConfig, seed: int, target_v: float) -> WorldConfig:
    """`config` with the defect at the size at which its unexplained rms is `target_v`, within 1 %."""
    share = _y_share(seed)
    clean, size = _noise_free(config.changed(defect.settings(0.0, share)), seed), 1.0
    for _ in range(12):
        changed = config.changed(defect.settings(size, share))
        rms = unexplained_rms_v(_noise_free(changed, seed), clean)
        if abs(rms / target_v - 1) < 0.01:
            return changed
        size *= target_v / rms
    raise ValueError(f"no size of {defect.story!r} gives {target_v} V; the last gave {rms} V")


@lru_cache(maxsize=16)
def _noise_free(config: WorldConfig, seed: int) -> Table:
    """Without the defect, and at its first size, a rig is the same whatever size is looked for."""
    return swept(config, seed, noise_free=True)


def unexplained_rms_v(table: Table, clean: Table) -> float:
    """Rms of the change of both voltages, less the best straight line per axis."""
    alpha, beta = np.radians(clean["alpha_deg"]), np.radians(clean["beta_deg"])
    loads = {"vx_v": np.sin(alpha) * np.cos(beta), "vy_v": np.sin(alpha) * np.sin(beta)}
    rests = [_off_line(load, table[name] - clean[name]) for name, load in loads.items()]
    return float(np.sqrt(np.mean(np.square(rests))))


def _off_line(load: NDArray[np.float64], change: NDArray[np.float64]) -> NDArray[np.float64]:
    line = np.column_stack([np.ones_like(load), load])
    return change - line @ np.linalg.lstsq(line, change, rcond=None)[0]


def _y_share(seed: int) -> float:
    """The y axis's share of the defect: between 0.6 and 1.4, of either sign."""
    random = np.random.default_rng([seed, 7])
    return float(random.uniform(0.6, 1.4) * random.choice([-1, 1]))


def _defective(defect: Defect, times_noise: float, seed: int) -> Table:
    return swept(scaled(defect, IDEAL, seed, times_noise * noise_floor_v()), seed)


def swept(config: WorldConfig, seed: int, noise_free: bool = False) -> Table:
    """A sweep on a rig of the given physics."""
    alpha, beta, direction = sweep()
    # No scatter of the defect itself: its size is the one that was chosen.
    config = config.changed({"spread": {"imperfection_fraction": 0.0}})
    return World(config, seed).dwell_mean(alpha, beta, direction=direction, noise_free=noise_free)
