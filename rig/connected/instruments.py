"""A bench file's instruments, connected: drivers by role, on real wires or on the twins that this process serves.

All simulated, `state` and `restore` continue a rig where it was, sample for sample.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Any, cast

from drivers.clock import SimulatedClock
from drivers.errors import DriverError
from drivers.instrument import Check, Identity
from drivers.instrument import Instrument as Driver
from drivers.links.link import Tap
from drivers.links.person import PersonLink
from drivers.links.server import Server
from drivers.manual_stage import ManualStage
from drivers.simulation.batch import Batch
from drivers.simulation.world import World
from procedures.errors import ProcedureError
from procedures.session import Dwell, Host, Session
from rig.bench import ROLES, Bench
from rig.connected.attended import AtTheRig
from rig.connected.guard import NOW_AND_THEN_S, GuardedClock, Look
from rig.connected.wiring import Wiring, wired
from rig.errors import InstrumentFailed

OVEN_TAKES_S = 0.5  # an answer of the oven, with room to spare
MOVING = ("alpha", "beta", "positioner")


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


def absent(role: str) -> Absent | None:
    """What stands in a role that the bench does not fill; nothing for the level, which a person can read."""
    if role == "level":
        return None
    return NoOven(role) if role == "oven" else Absent(role)


@dataclass(frozen=True)
class Rig:
    """A connected bench."""

    bench: Bench
    drivers: Mapping[str, Driver]
    clock: GuardedClock
    world: World | Batch | None  # of the simulated instruments
    servers: tuple[Server, ...]
    person: PersonLink

    def session(self, host: Host) -> Session:
        """What a procedure is given; from now on `host` answers for the person at the rig."""
        self.person.attended_by = AtTheRig(host)
        parts: dict[str, Any] = {role: self.drivers.get(role) or absent(role) for role in ROLES}
        return Session(**parts, clock=self.clock, host=host, limits=self.bench.limits, steady=_at_rest)

    def read_deg(self) -> dict[str, float]:
        """What the dials of stages that are turned by hand showed last, by role."""
        dials = {role: driver.read_deg for role, driver in self.drivers.items() if isinstance(driver, ManualStage)}
        return {role: read_deg for role, read_deg in dials.items() if read_deg is not None}

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
        clock = self.clock.inner
        if self.world is None or not isinstance(clock, SimulatedClock):
            return
        self.world.restore(state["world"])
        for server, kept in zip(self.servers, state["servers"], strict=True):
            server.restore(kept)
        clock.restore(state["clock_s"])

    def require_steady(self) -> None:
        """Raises the error of a stage that stands no longer where it was sent, or of an oscillation that has ended."""
        for driver in self._moving():
            getattr(driver, "require_steady", _nothing)()

    def look(self) -> None:
        """Raises what keeps this rig from moving: an open interlock, an alarm."""
        for driver in self._watched():
            driver.look()

    def guarded(self, session: Session) -> AbstractContextManager[None]:
        """Inside, every wait looks at interlocks, alarms and the oven, and raises what it finds."""
        looks = [Look(driver.look) for driver in self._watched()]
        if "oven" in self.drivers:
            looks.append(
                Look(lambda: session.check_temperature(session.oven.temperature_c()), NOW_AND_THEN_S, OVEN_TAKES_S)
            )
        return self.clock.guarded(looks)

    def _watched(self) -> list[Any]:
        """Drivers that can be looked at.

        In simulated time none is where there are no interlocks: then the end of a move is soon enough for an alarm.
        """
        adc = self.bench.instruments.get("adc")
        if self.bench.simulated and not (adc and adc.typed_settings().interlocks):
            return []
        return [driver for driver in self.drivers.values() if hasattr(driver, "look")]

    def stop(self) -> list[str]:
        """Stop all that moves, at once and whatever else is wrong, then the oven's heat; what could not be stopped.

        All are told to stop before the first is waited for. The limits of temperature are looked at by a run only:
        without one, nobody watches the oven.
        """
        movers, oven = self._moving(), cast(Any, self.drivers.get("oven"))
        for mover in movers:
            _failure(getattr(mover, "halt", _nothing))
        failed = [(f"{mover.name} may still move", _failure(mover.stop)) for mover in movers]
        if oven is not None:
            failed.append((f"{oven.name} may still heat", _failure(lambda: oven.run(False))))
        return [f"{what}: {failure}" for what, failure in failed if failure is not None]

    def _moving(self) -> list[Any]:
        return [self.drivers[role] for role in MOVING if role in self.drivers]


def _failure(act: Callable[[], object]) -> Exception | None:
    """What went wrong in `act`. Whatever it is, the others must be stopped as well."""
    try:
        act()
    except Exception as failure:
        return failure
    return None


def _nothing() -> None:
    """What an instrument does that has no such thing to do."""


def _at_rest(dwells: Sequence[Dwell], oven_c: float) -> bool:
    from rig.results.soak import steady  # what it is judged by is only loaded where somebody asks

    return steady(dwells, oven_c)


@contextmanager
def connected(bench: Bench, tap: Tap | None = None) -> Iterator[Rig]:
    """The bench with every instrument connected; all wires and servers are closed at the end.

    `tap` is told of every message.
    Raises InstrumentFailed with role, address and remedy; Busy where another process uses a real instrument.
    """
    with wired(bench, tap) as wiring:
        drivers = {role: wiring.connect(role) for role in bench.instruments}
        servers = tuple(wiring.servers.values())
        yield Rig(bench, drivers, wiring.clock, wiring.world if servers else None, servers, wiring.links.person)


def checked(bench: Bench) -> dict[str, tuple[Identity | None, list[Check]]]:
    """Identity and self-test of every instrument; one that does not answer has no identity and says why."""
    with wired(bench) as wiring:
        return {role: _check(wiring, role) for role in bench.instruments}


def _check(wiring: Wiring, role: str) -> tuple[Identity | None, list[Check]]:
    try:
        driver = wiring.connect(role)
        return driver.identify(), driver.self_test()
    except (DriverError, InstrumentFailed) as error:
        return None, [Check("answers", False, str(error))]
