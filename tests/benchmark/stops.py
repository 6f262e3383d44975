"""From a fault to the stop command on the wire, in real time: `python -m tests.benchmark.stops [TIMES]`.

Twins are served by a thread on the wall clock; a stage turns; a fault comes at a random moment. The time is when
the drive receives the stop, on the clock that the fault is set by. First all kernels are compiled: in a fresh
environment this takes minutes.
"""

from __future__ import annotations

import json
import os
import random
import signal
import statistics
import sys
import threading
from contextlib import suppress
from unittest.mock import patch

from drivers.clock import WallClock, serve_forever
from drivers.oriental_az import registers as az
from drivers.oriental_az.twin import Drive
from drivers.transport import Links
from drivers.transport.faults import Fault, faults_of
from rig.bench import read_bench
from rig.instruments.guard import GuardedClock
from rig.instruments.instruments import Rig
from rig.instruments.wiring import Wiring, serve, world_of
from rig.runs.signals import stoppable
from rig.warm import main as compile_all
from tests.rig.misbehaving import guarded_bench

TARGET_S = 0.1
FAULTS = {
    "interlock opens": ("adc", "open-interlock"),
    "alarm of the other stage": ("beta", "alarm"),
    "the converter's connection is lost": ("adc", "disconnect"),
}
SIGNAL = "Ctrl-C"


def latency_s(what: str, luck: random.Random) -> float:
    """One stop."""
    bench = guarded_bench(read_bench())
    wall, told = WallClock(), []
    servers = serve(bench, world_of(bench))
    clock, ended = GuardedClock(wall), threading.Event()
    thread = threading.Thread(target=serve_forever, args=(list(servers.values()), ended.is_set, wall), daemon=True)
    thread.start()
    inputs = Drive._inputs

    def listening(drive: Drive, rising: int, now_s: float) -> None:
        if rising & az.STOP:
            told.append(wall.now())
        inputs(drive, rising, now_s)

    links = Links(clock)
    try:
        with patch.object(Drive, "_inputs", listening):
            wiring = Wiring(bench, clock, links, world_of(bench), servers)
            drivers = {role: wiring.connect(role) for role in ("alpha", "beta", "adc")}
            rig = Rig(bench, drivers, clock, None, tuple(servers.values()), links.person)
            drivers["alpha"].home()  # type: ignore[attr-defined]
            begun_s = wall.now() + luck.uniform(0.1, 0.6)
            _let_happen(what, begun_s, wall, servers)
            with suppress(Exception, KeyboardInterrupt), stoppable(), rig.guarded(_nobody()):
                drivers["alpha"].move_to(360.0)  # type: ignore[attr-defined]
            rig.stop()
    finally:
        ended.set()
        thread.join()
        links.close()
        for server in servers.values():
            server.close()
    return told[0] - begun_s


def _let_happen(what: str, at_s: float, wall: WallClock, servers: dict[str, object]) -> None:
    """A fault, or a signal, at that time."""
    if what == SIGNAL:
        threading.Timer(at_s - wall.now(), os.kill, (os.getpid(), signal.SIGINT)).start()
        return
    role, kind = FAULTS[what]
    driver = "oriental_az" if role == "beta" else "labjack_t7"
    server = next(server for roles, server in servers.items() if role in roles.split())
    server.afflict(role, faults_of(driver, [Fault(kind, at_s=at_s)]))  # type: ignore[attr-defined]


def _nobody() -> object:
    """No oven is looked at, so no session is asked."""
    return None


def main(times: int = 20) -> None:
    luck = random.Random(1)
    compile_all()  # else the first exchange with a twin runs out of time
    latency_s(SIGNAL, luck)  # what is loaded first is not counted
    found = {what: [latency_s(what, luck) for _ in range(times)] for what in (*FAULTS, SIGNAL)}
    longest = max(max(each) for each in found.values())
    said = {
        what: {"median_ms": round(1e3 * statistics.median(each), 1), "longest_ms": round(1e3 * max(each), 1)}
        for what, each in found.items()
    }
    print(json.dumps({"stops": said, "longest_s": longest, "target_s": TARGET_S, "met": longest <= TARGET_S}, indent=1))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
