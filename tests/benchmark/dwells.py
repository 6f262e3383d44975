"""The means of 518 dwells in the simulated world, without sockets: what statistics over rigs are made of."""

from __future__ import annotations

import json

from drivers.world.config import WorldConfig
from drivers.world.world import World
from tests.benchmark.timed import seconds
from tests.hidden.rigs import sweep


def main() -> None:
    alpha, beta, direction = sweep()
    world = World(WorldConfig.adxl203(), seed=1)
    world.dwell_mean(alpha, beta, direction=direction)
    print(json.dumps({"seconds": seconds(lambda: world.dwell_mean(alpha, beta, direction=direction), 9)}))


if __name__ == "__main__":
    main()
