"""What the program adds to moves and dwells: poses in real time, the simulated instruments served by a thread.

Needed is what the mechanics and the record need: every move's trapezoid, every dwell's scans. The rest is overhead.
"""

from __future__ import annotations

import json
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from drivers import labjack_t7, labjack_t7_twin, oriental_az, oriental_az_twin
from drivers.clock import WallClock, serve_forever
from drivers.links import Links
from drivers.simulation.config import WorldConfig
from drivers.simulation.trajectory import Trajectory
from drivers.simulation.world import World

STAGE = oriental_az.Settings()
CONVERTER = labjack_t7.Settings()
STEP_DEG = 10.0


@dataclass(frozen=True)
class Bench:
    """A stage and a converter in real time."""

    clock: WallClock
    beta: oriental_az.RotaryStage
    adc: labjack_t7.T7


@contextmanager
def served() -> Iterator[Bench]:
    """The bench; its twins run in a thread until the end."""
    world, over = World(WorldConfig.adxl203(), seed=1), threading.Event()
    labjack_t7_twin.Inputs(world, {0: "vx"}).codes([0], [10.0], 0.0, 1e-3, 101)  # compiled before the clock runs
    clock = WallClock(world.now_s)
    servers = [
        oriental_az_twin.serve(world, {"beta": (1, STAGE)}),
        labjack_t7_twin.serve(world, {"adc": (1, CONVERTER)}),
    ]
    at = {role: address for server in servers for role, address in server.addresses.items()}
    thread = threading.Thread(target=serve_forever, args=(servers, over.is_set, clock))
    with ExitStack() as stack:
        for server in servers:
            stack.callback(server.close)
        thread.start()
        stack.callback(thread.join)
        stack.callback(over.set)
        links = Links(clock)
        stack.callback(links.close)
        beta = oriental_az.connect(at["beta"], links, STAGE, "beta")
        yield Bench(clock, beta, labjack_t7.connect(at["adc"], links, CONVERTER, "adc"))


def overhead_s(bench: Bench, poses: int, dwell_s: float) -> tuple[list[float], list[float]]:
    """Of each move and of each dwell, beyond what it needs."""
    move_s = Trajectory(0.0, 0.0, STEP_DEG, STAGE.speed_deg_s, STAGE.acceleration_deg_s2).end_s
    moves, dwells, now = [], [], bench.clock.now
    for pose in range(poses):
        began = now()
        bench.beta.move_to(STEP_DEG * (pose + 1))
        arrived = now()
        bench.adc.acquire(dwell_s)
        moves.append(arrived - began - move_s)
        dwells.append(now() - arrived - dwell_s)
    return moves, dwells


def main(poses: str, dwell: str) -> None:
    count, dwell_s = int(poses), float(dwell)
    with served() as bench:
        bench.beta.home()
        began = bench.clock.now()
        moves, dwells = overhead_s(bench, count, dwell_s)
        seconds = bench.clock.now() - began
    added = sum(moves) + sum(dwells)
    shares = {"of_moves_ms": 1e3 * sum(moves) / count, "of_dwells_ms": 1e3 * sum(dwells) / count}
    print(json.dumps({"seconds": seconds, "overhead": added / (seconds - added), **shares}))


if __name__ == "__main__":
    main(*sys.argv[1:])
