"""The wires of a bench: servers of the twins, the clock, and the address of each role.

If all instruments are simulated, time is simulated, and the twins act while the controller waits. If some are
simulated, time is real, and a thread serves the twins.
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
from drivers.handheld.world import HandheldWorld, handheld
from drivers.instrument import Instrument as Driver
from drivers.transport import Address, Links
from drivers.transport.address import Url
from drivers.transport.faults import faults_of
from drivers.transport.link import Tap
from drivers.transport.person import PERSON
from drivers.transport.server import Server
from drivers.world.batch import AnyWorld, Batch
from drivers.world.config import WorldConfig
from drivers.world.world import World
from rig.bench import Bench
from rig.bench.check import check_lines
from rig.errors import InstrumentFailed
from rig.files import home, machine
from rig.instruments.guard import GuardedClock
from rig.lease import lease


@dataclass(frozen=True)
class Wiring:
    """Clock, links and servers of a bench. The key of a server is the list of its roles."""

    bench: Bench
    clock: GuardedClock
    links: Links
    world: AnyWorld
    servers: Mapping[str, Server]

    def connect(self, role: str) -> Driver:
        """The driver in `role`. Raises InstrumentFailed with role, address and remedy."""
        instrument, address = self.bench.instruments[role], self._address(role)
        module = importlib.import_module(f"drivers.{instrument.driver}.driver")
        try:
            return cast(Driver, module.connect(address, self.links, instrument.parse_settings(), role))
        except LinkRefused as error:
            reason = str(error).removeprefix(f"{role}: ").removeprefix(f"{address.url}: ")
            raise InstrumentFailed(f"{role} ({instrument.driver}) at {address.url}: {reason}") from error

    def _address(self, role: str) -> Address:
        if not self.bench.instruments[role].simulated:
            return self.bench.instruments[role].address
        return next(server.addresses[role] for roles, server in self.servers.items() if role in roles.split())


@contextmanager
def open_wires(bench: Bench, tap: Tap | None = None) -> Iterator[Wiring]:
    """The wires of the bench, before any instrument is connected. All wires and servers are closed at the end.

    `tap` is called for every message. Raises BenchError for two roles on one unit of one line, and Busy if another
    process of this computer uses a real instrument: a second connection would disturb it. Another computer is not seen,
    see `on_a_network`.
    """
    check_lines(bench, f"bench {bench.name!r}, key instruments")  # a bench from a record has no file
    with ExitStack() as stack:
        urls = {i.url for i in bench.instruments.values() if not i.simulated} - {PERSON}
        for line, url in sorted({Url.parse(url).line: url for url in sorted(urls)}.items()):
            stack.enter_context(lease(machine(), f"wire-{hashlib.sha256(line.encode()).hexdigest()[:16]}", url, home()))
        world = world_of(bench)
        servers = serve(bench, world)
        for server in servers.values():
            stack.callback(server.close)
        clock = GuardedClock(SimulatedClock() if bench.simulated else WallClock())
        stack.enter_context(_pump(list(servers.values()), clock.inner))
        links = Links(clock, tap)
        stack.callback(links.close)
        yield Wiring(bench, clock, links, world, servers)


def on_a_network(bench: Bench) -> list[str]:
    """The roles of real instruments that other computers can reach. The lock of a wire holds for this computer only."""
    real_instruments = {
        role: part for role, part in bench.instruments.items() if not part.simulated and part.url != PERSON
    }
    return [role for role, part in real_instruments.items() if Url.parse(part.url).on_a_network]


def world_of(bench: Bench) -> AnyWorld:
    """The simulated world of the bench file, with every sensor of a batch, or with a sensor in a hand."""
    settings, hand = handheld(bench.world)
    config = WorldConfig.from_mapping(settings)
    if hand is not None:
        return HandheldWorld(config, bench.seed, hand)
    if not bench.sensors:
        return World(config, bench.seed)
    return Batch(config, bench.seed, {name: sensor.world for name, sensor in bench.sensors.items()})


def serve(bench: Bench, world: AnyWorld) -> dict[str, Server]:
    """The servers of all simulated instruments, by their roles: one server for each wire."""
    wires = defaultdict(list)
    for role, instrument in bench.instruments.items():
        if instrument.simulated:
            wires[instrument.driver, instrument.listen].append(role)
    servers = {}
    for (driver, listen), roles in wires.items():
        twin = importlib.import_module(f"drivers.{driver}.twin")
        units = {role: (bench.instruments[role].unit, bench.instruments[role].parse_settings()) for role in roles}
        server = servers[" ".join(roles)] = twin.serve(world, units, listen or twin.LISTEN)
        for role in roles:
            if faults := bench.instruments[role].faults:
                server.afflict(role, faults_of(driver, faults))
    return servers


@contextmanager
def _pump(servers: list[Server], clock: Clock) -> Iterator[None]:
    """Let the servers act while the controller waits, or in a thread in real time."""
    if isinstance(clock, SimulatedClock):
        for server in servers:
            clock.attach(server)
        yield
        return
    stop_event = threading.Event()
    thread = threading.Thread(target=serve_forever, args=(servers, stop_event.is_set, clock), daemon=True)
    if servers:
        thread.start()
    try:
        yield
    finally:
        stop_event.set()
        if servers:
            thread.join()
