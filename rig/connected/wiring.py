"""The wires of a bench: twins served for its simulated instruments, a clock for all, and each role's address.

All simulated: time is simulated, and the twins act while the controller waits. Some simulated: time is real, and the
twins are served by a thread.
"""

from __future__ import annotations

import hashlib
import importlib
import threading
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import cast

from drivers.clock import Clock, SimulatedClock, WallClock, serve_forever
from drivers.errors import LinkRefused
from drivers.instrument import Instrument as Driver
from drivers.links import Address, Links
from drivers.links.link import Tap
from drivers.links.person import PERSON
from drivers.links.server import Server
from drivers.links.wire_faults import faults_of
from drivers.simulation.batch import Batch
from drivers.simulation.config import WorldConfig
from drivers.simulation.world import World
from rig.bench import Bench
from rig.connected.guard import GuardedClock
from rig.errors import InstrumentFailed
from rig.home import home
from rig.lease import lease


@dataclass(frozen=True)
class Wiring:
    """What the instruments of a bench are connected by; `servers` by the roles that each plays."""

    bench: Bench
    clock: GuardedClock
    links: Links
    world: World | Batch
    servers: Mapping[str, Server]

    def connect(self, role: str) -> Driver:
        """The driver in `role`. Raises InstrumentFailed with role, address and remedy."""
        instrument, address = self.bench.instruments[role], self._address(role)
        module = importlib.import_module(f"drivers.{instrument.driver}")
        try:
            return cast(Driver, module.connect(address, self.links, instrument.typed_settings(), role))
        except LinkRefused as error:
            raise InstrumentFailed(f"{role} ({instrument.driver}) at {address.url}: {error}") from error

    def _address(self, role: str) -> Address:
        if not self.bench.instruments[role].simulated:
            return self.bench.instruments[role].address
        return next(server.addresses[role] for roles, server in self.servers.items() if role in roles.split())


@contextmanager
def wired(bench: Bench, tap: Tap | None = None) -> Iterator[Wiring]:
    """The bench's wires, before any instrument is connected; all wires and servers are closed at the end.

    `tap` is told of every message. Raises Busy where another process uses a real instrument, which connecting to it
    would disturb.
    """
    with ExitStack() as stack:
        for url in sorted({i.url for i in bench.instruments.values() if not i.simulated} - {PERSON}):
            stack.enter_context(lease(home(), f"wire-{hashlib.sha256(url.encode()).hexdigest()[:16]}", url))
        world = world_of(bench)
        servers = serve(bench, world)
        for server in servers.values():
            stack.callback(server.close)
        clock = GuardedClock(SimulatedClock() if bench.simulated else WallClock())
        stack.enter_context(_pumped(list(servers.values()), clock.inner))
        links = Links(clock, tap)
        stack.callback(links.close)
        yield Wiring(bench, clock, links, world, servers)


def world_of(bench: Bench) -> World | Batch:
    """The simulated world that the bench file describes, with every sensor of a batch."""
    config = WorldConfig.from_mapping(bench.world)
    if not bench.sensors:
        return World(config, bench.seed)
    return Batch(config, bench.seed, {name: sensor.world for name, sensor in bench.sensors.items()})


def serve(bench: Bench, world: World | Batch) -> dict[str, Server]:
    """The servers of all simulated instruments, each under the roles that it plays; one wire, one server."""
    wires = defaultdict(list)
    for role, instrument in bench.instruments.items():
        if instrument.simulated:
            wires[instrument.driver, instrument.listen].append(role)
    servers = {}
    for (driver, listen), roles in wires.items():
        twin = importlib.import_module(f"drivers.{driver}_twin")
        units = {role: (bench.instruments[role].unit, bench.instruments[role].typed_settings()) for role in roles}
        server = servers[" ".join(roles)] = twin.serve(world, units, listen or twin.LISTEN)
        for role in roles:
            if faults := bench.instruments[role].faults:
                server.afflict(role, faults_of(driver, faults))
    return servers


@contextmanager
def _pumped(servers: list[Server], clock: Clock) -> Iterator[None]:
    """Let the servers act while the controller waits, or in real time beside it."""
    if isinstance(clock, SimulatedClock):
        for server in servers:
            clock.attach(server)
        yield
        return
    ended = threading.Event()
    thread = threading.Thread(target=serve_forever, args=(servers, ended.is_set, clock), daemon=True)
    if servers:
        thread.start()
    try:
        yield
    finally:
        ended.set()
        if servers:
            thread.join()
