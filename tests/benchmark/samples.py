"""Samples of one dwell, 5000 of three channels, as the simulated world makes them."""

from __future__ import annotations

import json

from drivers.world.config import WorldConfig
from drivers.world.world import World
from tests.benchmark.timed import seconds


def main() -> None:
    world = World(WorldConfig.adxl203(), seed=1)

    def dwell() -> None:
        world.adc_volts(["vx", "vy", "supply"], world.now_s + 1e-3, 1e-3, 5000)

    dwell()
    print(json.dumps({"seconds": seconds(dwell, 20)}))


if __name__ == "__main__":
    main()
