"""A bench file's instruments, connected: drivers by role, on real wires or on the twins that this process serves.

All simulated: time is simulated, and `state` and `restore` continue a rig where it was, sample for sample. Some
simulated: time is real, and the twins are served by a thread.
"""

from __future__ import annotations

import hashlib
import importlib
import threading
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any, cast

from drivers.clock import Clock, SimulatedClock, WallClock, serve_forever
from drivers.errors import DriverError, LinkRefused
from drivers.instrument import Check, Identity
from drivers.instrument import Instrument as Driver
from drivers.links import Address, Links
from drivers.links.server import Server
from drivers.simulation.config import WorldConfig
from drivers.simulation.world import World
from procedures.errors import ProcedureError
from procedures.session import Host, Session
from rig.bench import ROLES, Bench
from rig.errors import InstrumentFailed
from rig.home import home
from rig.lease import lease


class SinceStart:
    """Real time from 0, as the world counts it."""

    def __init__(self) -> None:
        self._wall = WallClock()
        self._start_s = self._wall.now()

    def now(self) -> float:
        return self._wall.now() - self._start_s

    def sleep(self, seconds: float) -> None:
        self._wall.sleep(seconds)

    def wait_readable(self, wire: Any, timeout_s: float) -> bool:
        return self._wall.wait_readable(wire, timeout_s)


class Absent:
    """Stands for an instrument that the bench file does not name: any use of it says so."""

    def __init__(self, role: str) -> None:
        self._role = role

    def referenced(self) -> bool:
        """A stage that is not there needs no homing."""
        return True

    def __getattr__(self, what: str) -> Any:
        raise ProcedureError(f"the bench has no {self._role}, which this procedure needs; name it in the bench file")


class NoOven(Absent):
    """A bench without oven and thermometer: the temperature is unknown, and nothing else can be asked."""

    def temperature_c(self) -> None:
        return None


def absent(role: str) -> Absent:
    """What stands in a role that the bench does not fill."""
    return NoOven(role) if role == "oven" else Absent(role)


@dataclass(frozen=True)
class Rig:
    """A connected bench."""

    bench: Bench
    drivers: Mapping[str, Driver]
    clock: Clock
    world: World | None  # of the simulated instruments
    servers: tuple[Server, ...]

    def session(self, host: Host) -> Session:
        """What a procedure is given."""
        parts: dict[str, Any] = {role: self.drivers.get(role) or absent(role) for role in ROLES}
        return Session(**parts, clock=self.clock, host=host, limits=self.bench.limits)

    def power_on_s(self) -> float | None:
        """The clock's reading when the sensor was powered; None where nobody knows."""
        return self.clock.now() - self.world.powered_s() if self.world and self.bench.simulated else None

    def identities(self) -> dict[str, Identity]:
        """Who answers in each role."""
        return {role: driver.identify() for role, driver in self.drivers.items()}

    def state(self) -> dict[str, Any] | None:
        """All that a simulated bench is at this moment; None where an instrument is real."""
        if self.world is None or not self.bench.simulated:
            return None
        servers = [server.state() for server in self.servers]
        return {"clock_s": self.clock.now(), "world": self.world.state(), "servers": servers}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Put a simulated bench back to where `state` was taken."""
        if self.world is None or not isinstance(self.clock, SimulatedClock):
            return
        self.world.restore(state["world"])
        for server, kept in zip(self.servers, state["servers"], strict=True):
            server.restore(kept)
        self.clock.restore(state["clock_s"])

    def stop(self) -> list[str]:
        """Stop both stages at once, whatever else is wrong; what could not be stopped."""
        failed = []
        for role in ("alpha", "beta"):
            stage = cast(Any, self.drivers.get(role))
            try:
                if stage is not None:
                    stage.stop()
            except DriverError as error:
                failed.append(f"{role} may still turn: {error}")
        return failed


@contextmanager
def connected(bench: Bench) -> Iterator[Rig]:
    """The bench with every instrument connected; all wires and servers are closed at the end.

    Raises InstrumentFailed with role, address and remedy; Busy where another process uses a real instrument, which
    connecting to it would disturb.
    """
    with ExitStack() as stack:
        for url in sorted({i.url for i in bench.instruments.values() if not i.simulated}):
            stack.enter_context(lease(home(), f"wire-{hashlib.sha256(url.encode()).hexdigest()[:16]}", url))
        world = World(WorldConfig.from_mapping(bench.world), bench.seed)
        servers = serve(bench, world)
        for server in servers.values():
            stack.callback(server.close)
        clock: Clock = SimulatedClock() if bench.simulated else SinceStart()
        stack.enter_context(_pumped(list(servers.values()), clock))
        links = Links(clock)
        stack.callback(links.close)
        drivers = {role: _connect(bench, role, servers, links) for role in bench.instruments}
        yield Rig(bench, drivers, clock, world if servers else None, tuple(servers.values()))


def serve(bench: Bench, world: World) -> dict[str, Server]:
    """The servers of all simulated instruments, each under the roles that it plays; one wire, one server."""
    wires = defaultdict(list)
    for role, instrument in bench.instruments.items():
        if instrument.simulated:
            wires[instrument.driver, instrument.listen].append(role)
    servers = {}
    for (driver, listen), roles in wires.items():
        twin = importlib.import_module(f"drivers.{driver}_twin")
        units = {role: (bench.instruments[role].unit, bench.instruments[role].typed_settings()) for role in roles}
        servers[" ".join(roles)] = twin.serve(world, units, listen or twin.LISTEN)
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


def _connect(bench: Bench, role: str, servers: Mapping[str, Server], links: Links) -> Driver:
    instrument = bench.instruments[role]
    address = _address(bench, role, servers)
    module = importlib.import_module(f"drivers.{instrument.driver}")
    try:
        return cast(Driver, module.connect(address, links, instrument.typed_settings(), role))
    except LinkRefused as error:
        raise InstrumentFailed(f"{role} ({instrument.driver}) at {address.url}: {error}") from error


def _address(bench: Bench, role: str, servers: Mapping[str, Server]) -> Address:
    if not bench.instruments[role].simulated:
        return bench.instruments[role].address
    return next(server.addresses[role] for roles, server in servers.items() if role in roles.split())


def checked(rig: Rig) -> dict[str, tuple[Identity | None, list[Check]]]:
    """Identity and self-test of every instrument; one that does not answer has no identity and says why."""
    return {role: _check(driver) for role, driver in rig.drivers.items()}


def _check(driver: Driver) -> tuple[Identity | None, list[Check]]:
    try:
        return driver.identify(), driver.self_test()
    except DriverError as error:
        return None, [Check("answers", False, str(error))]
