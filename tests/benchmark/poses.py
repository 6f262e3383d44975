"""What a sweep adds to its moves and dwells in real time: the simulated instruments are served by a thread.

Needed is what the mechanics and the record need: every move's trapezoid, the settling, every dwell's scans. The rest
is overhead: exchanges on the wires at their true speed, polls, the stream's start and stop.
"""

from __future__ import annotations

import json
import sys
import threading
from collections import defaultdict
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from drivers.clock import WallClock, serve_forever
from drivers.labjack_t7 import driver as labjack_t7
from drivers.labjack_t7 import twin as labjack_t7_twin
from drivers.omega_cn7500 import driver as omega_cn7500
from drivers.omega_cn7500 import twin as omega_cn7500_twin
from drivers.oriental_az import driver as oriental_az
from drivers.oriental_az import twin as oriental_az_twin
from drivers.transport import Links
from drivers.world.config import WorldConfig
from drivers.world.stage import Trajectory
from drivers.world.world import World

STAGE, CONVERTER, OVEN = oriental_az.Settings(), labjack_t7.Settings(), omega_cn7500.Settings()
STEP_DEG, SETTLE_S = 10.0, 0.5


@dataclass(frozen=True)
class Bench:
    """All that a sweep needs, in real time."""

    clock: WallClock
    alpha: oriental_az.RotaryStage
    beta: oriental_az.RotaryStage
    adc: labjack_t7.T7
    oven: omega_cn7500.Oven


@contextmanager
def served() -> Iterator[Bench]:
    """The bench; its twins run in a thread until the end."""
    world, over = World(WorldConfig.adxl203(), seed=1), threading.Event()
    labjack_t7_twin.Inputs(world, {0: "vx"}).codes([0], [10.0], 0.0, 1e-3, 101)  # compiled before the clock runs
    clock = WallClock(world.now_s)
    servers = [
        oriental_az_twin.serve(world, {"alpha": (1, STAGE), "beta": (2, STAGE)}),
        labjack_t7_twin.serve(world, {"adc": (1, CONVERTER)}),
        omega_cn7500_twin.serve(world, {"oven": (1, OVEN)}),
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
        yield Bench(
            clock,
            oriental_az.connect(at["alpha"], links, STAGE, "alpha"),
            oriental_az.connect(at["beta"], links, STAGE, "beta"),
            labjack_t7.connect(at["adc"], links, CONVERTER, "adc"),
            omega_cn7500.connect(at["oven"], links, OVEN, "oven"),
        )


def sweep(bench: Bench, poses: int, dwell_s: float) -> dict[str, float]:
    """Poses along beta as a sweep visits them; how long each of its parts took, in s."""
    took: dict[str, float] = defaultdict(float)
    began = bench.clock.now()

    def done(part: str) -> None:
        nonlocal began
        now = bench.clock.now()
        took[part] += now - began
        began = now

    for pose in range(poses):
        bench.alpha.move_to(0.0)
        done("alpha")
        bench.beta.angle_deg()
        bench.beta.move_to(STEP_DEG * (pose + 1))
        done("beta")
        bench.clock.sleep(SETTLE_S)
        done("settling")
        bench.adc.acquire_with(dwell_s, bench.oven.temperature_c)
        done("dwell")
        bench.alpha.require_steady()
        bench.beta.require_steady()
        done("standing")
    return took


def needed(dwell_s: float) -> dict[str, float]:
    """What the parts of one pose need, in s."""
    move_s = Trajectory(0.0, 0.0, STEP_DEG, STAGE.speed_deg_s, STAGE.acceleration_deg_s2).end_s
    return {"alpha": 0.0, "beta": move_s, "settling": SETTLE_S, "dwell": dwell_s, "standing": 0.0}


def main(poses: str, dwell: str) -> None:
    count, least = int(poses), needed(float(dwell))
    with served() as bench:
        bench.alpha.home()
        bench.beta.home()
        took = sweep(bench, count, float(dwell))
    added = {f"{part}_added_ms": 1e3 * (took[part] / count - least[part]) for part in least}
    overhead = sum(took.values()) / count / sum(least.values()) - 1
    print(json.dumps({"seconds": sum(took.values()), "overhead": overhead, **added}))


if __name__ == "__main__":
    main(*sys.argv[1:])
