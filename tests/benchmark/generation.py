"""Raw samples of a still rig: the simulated world and its converter, against the same content out of numpy and scipy.

The plain pipeline is what one would write first: per output white noise, six AR(1) processes (five decades of flicker
noise and a random walk), the RC filter, the converter's noise, 16-bit codes; lfilter for everything recursive. The
world has the same processes, steps the slow ones every 0.1 s, and moreover samples the channels one after the other.
Both are measured in turns, so that other load on the machine meets both.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from drivers.labjack_t7.stream import RangeCalibration
from drivers.labjack_t7.twin import FLASH_WORDS, Inputs
from drivers.world.config import WorldConfig
from drivers.world.world import World

SCANS, INTERVAL_S = 10_000, 1e-3  # what the simulated clock lets a stream gather at most: 10 s
OUTPUTS = ("vx", "vy")  # every channel with all of that
SOAK = ("vx", "vy", "supply", "thermistor")  # two of four channels with the converter's noise only
SLOW_S = (1.0, 10.0, 100.0, 1e3, 1e4, 1e7)
CONFIG = WorldConfig.adxl203().changed({"noise": {"walk_v_per_sqrt_h": 1e-5}})

Codes = NDArray[np.uint16]


def by_world(channels: tuple[str, ...]) -> Callable[[], Codes]:
    """Makes the next SCANS scans, shape (SCANS, channels)."""
    world, numbers = World(CONFIG, seed=1), range(len(channels))
    inputs = Inputs(world, dict(enumerate(channels)))
    return lambda: inputs.codes(numbers, [10.0] * len(channels), world.now_s + INTERVAL_S, INTERVAL_S, SCANS)


def by_numpy(channels: tuple[str, ...]) -> Callable[[], Codes]:
    """As `by_world`, in whole-array operations."""
    random, calibration = np.random.default_rng(1), RangeCalibration.from_flash(FLASH_WORDS, 10.0)

    def codes(channel: str) -> Codes:
        volts = output_v(random) if channel in ("vx", "vy") else np.full(SCANS, 2.5)
        volts += CONFIG.converter.noise_v * random.standard_normal(SCANS)
        rounded = np.rint(calibration.center + volts / calibration.positive_slope)
        return np.clip(rounded, 0, 65535).astype(np.uint16)

    return lambda: np.column_stack([codes(channel) for channel in channels])


def output_v(random: np.random.Generator) -> NDArray[np.float64]:
    """White noise and six slow processes behind the filter."""
    noise = CONFIG.noise.x
    kept = math.exp(-INTERVAL_S / (noise.filter_ohm * noise.filter_farad))
    white_v = noise.white_v * math.sqrt((1 + kept) / (1 - kept))
    volts = 2.5 + white_v * random.standard_normal(SCANS)
    for time_s in SLOW_S:
        a = math.exp(-INTERVAL_S / time_s)
        step_v = noise.flicker_v * math.sqrt(1 - a * a)
        volts += lfilter([step_v], [1, -a], random.standard_normal(SCANS))
    return np.asarray(lfilter([1 - kept], [1, -kept], volts))


def compared(channels: tuple[str, ...], repeats: int = 15) -> dict[str, Any]:
    """Processor time per sample of both, in turns, and the median of their ratios."""
    makers = by_world(channels), by_numpy(channels)
    taken = [[_ns_per_sample(make) for make in makers] for _ in range(repeats + 1)][1:]
    world_ns, numpy_ns = (median(column) for column in zip(*taken, strict=True))
    ratio = median(numpy / world for world, numpy in taken)
    return {"world_ns": world_ns, "numpy_ns": numpy_ns, "times_faster": ratio}


def _ns_per_sample(make: Callable[[], Codes], calls: int = 5) -> float:
    began = time.process_time()
    samples = sum(make().size for _ in range(calls))
    return 1e9 * (time.process_time() - began) / samples


def main() -> None:
    print(json.dumps({"outputs": compared(OUTPUTS), "soak": compared(SOAK)}))


if __name__ == "__main__":
    main()
