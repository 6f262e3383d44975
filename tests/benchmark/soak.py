"""Twelve hours of four channels at 1 kHz: every sample through the sockets, decoded, and kept in a record."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager

from drivers.clock import SimulatedClock
from drivers.labjack_t7 import driver as labjack_t7
from drivers.labjack_t7 import twin as labjack_t7_twin
from drivers.transport import Links
from drivers.world.config import WorldConfig
from drivers.world.world import World
from procedures.session import Pose
from rig.record import KeptPose, Record

SETTINGS = labjack_t7.Settings(channels={"vx": 0, "vy": 1, "supply": 2, "thermistor": 3}, rate_hz=1000.0)
BLOCK_S = 60.0


@contextmanager
def converter(seed: int = 1) -> Iterator[tuple[World, SimulatedClock, labjack_t7.T7]]:
    """A world, the clock that moves it, and the driver at a simulated converter."""
    world, clock = World(WorldConfig.adxl203(), seed), SimulatedClock()
    server = labjack_t7_twin.serve(world, {"adc": (1, SETTINGS)})
    clock.attach(server)
    links = Links(clock)
    try:
        yield world, clock, labjack_t7.connect(server.addresses["adc"], links, SETTINGS, "adc")
    finally:
        links.close()
        server.close()


def soak(record: Record, duration_s: float, block_s: float = BLOCK_S) -> str:
    """Keep a stream block by block, each with the state of the bench as a run does; the run's id."""
    run = record.begin(
        "soak", {}, bench={}, identities={}, configuration="", constants={}, source="the simulated converter"
    )
    with converter() as (world, clock, adc), closing(adc.stream(duration_s, block_s)) as blocks:
        for number, samples in enumerate(blocks):
            kept = KeptPose(Pose(90.0, 0.0), samples, samples.start_s, None)
            record.keep(run, number, kept, {"world": world.state(), "clock": clock.now()})
    return run


def main(hours: str) -> None:
    began = time.perf_counter()
    with Record() as record:
        soak(record, 3600 * float(hours))
    seconds, used = time.perf_counter() - began, time.process_time()
    size = sum(file.stat().st_size for file in record.path.parent.glob("record.db*"))
    print(json.dumps({"seconds": [seconds], "processor_s": used, "disk_mb": size / 1e6}))


if __name__ == "__main__":
    main(sys.argv[1])
