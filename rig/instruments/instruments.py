"""The connected instruments of a bench: drivers by role, on real wires or on twins in this process.

With twins only, `state` and `restore` continue a simulated rig at the same sample.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Any, cast

from drivers.clock import SimulatedClock
from drivers.errors import DriverError
from drivers.instrument import CanHalt, CanLook, Check, CountsSamples, HasStopInput, Identity, KeepsSteady
from drivers.instrument import Instrument as Driver
from drivers.manual_stage.driver import ManualStage
from drivers.transport.link import Tap
from drivers.transport.person import PersonLink
from drivers.transport.server import Server
from drivers.world.batch import AnyWorld
from procedures.errors import NoInstrument
from procedures.instruments import Oven, Stage
from procedures.questions import Dial
from procedures.session import Dwell, Host, Session
from rig.bench import ROLES, Bench
from rig.errors import InstrumentFailed
from rig.instruments.by_hand import HandAnalysis
from rig.instruments.guard import NOW_AND_THEN_S, GuardedClock, Look
from rig.instruments.wiring import Wiring, open_wires


@dataclass(frozen=True)
class Technician:
    """The person at the rig, for drivers that ask one. Its questions are questions of the run.

    So a file of answers, the simulated technician and `--unattended` also answer them, and the record keeps the answer.
    """

    host: Host

    def ask(self, name: str, text: str, unit: str, low: float, high: float, expected: float | None = None) -> float:
        """The number that the person reads. Raises NoAnswer, BadAnswer."""
        stage = name.partition("-")[0]
        return float(self.host.ask(Dial(name, text, unit=unit, low=low, high=high, stage=stage, expected=expected)))


OVEN_ANSWER_S = 0.5  # an answer of the oven, with a margin
MOVING = ("alpha", "beta", "positioner")
STILL_MOVES = "may still move: press the emergency stop, or switch its drive off"
STILL_HEATS = "may still heat: switch it off by hand"


class Absent:
    """The place of an instrument that is not in the bench file. Every use raises NoInstrument."""

    def __init__(self, role: str) -> None:
        self._role = role

    def referenced(self) -> bool:
        """An absent stage needs no homing."""
        return True

    def __getattr__(self, name: str) -> Any:
        raise NoInstrument(f"the bench has no {self._role}, but this procedure needs it; add it to the bench file")


class NoOven(Absent):
    """A bench without oven and thermometer: the temperature is unknown. Every other use raises NoInstrument."""

    def temperature_c(self) -> None:
        return None


def absent(role: str) -> Absent | None:
    """The object for a role without an instrument; None for the level, because a person can read one."""
    if role == "level":
        return None
    return NoOven(role) if role == "oven" else Absent(role)


@dataclass(frozen=True)
class Rig:
    """A connected bench."""

    bench: Bench
    drivers: Mapping[str, Driver]
    clock: GuardedClock
    world: AnyWorld | None  # of the simulated instruments
    servers: tuple[Server, ...]
    person: PersonLink

    def session(self, host: Host) -> Session:
        """The session of a procedure. From now on `host` answers the questions to the person at the rig."""
        self.person.attended_by = Technician(host)
        parts: dict[str, Any] = {role: self.drivers.get(role) or absent(role) for role in ROLES}
        return Session(
            **parts, clock=self.clock, host=host, limits=self.bench.limits, steady=_is_steady, by_hand=HandAnalysis()
        )

    def read_deg(self) -> dict[str, float]:
        """The last readings of the dials of manual stages, by role."""
        dials = {role: driver.read_deg for role, driver in self.drivers.items() if isinstance(driver, ManualStage)}
        return {role: read_deg for role, read_deg in dials.items() if read_deg is not None}

    def power_on_s(self) -> float | None:
        """The clock's time when the sensor was powered; None if unknown."""
        return self.clock.now() - self.world.powered_s() if self.world and self.bench.simulated else None

    def identities(self) -> dict[str, Identity]:
        """The identity of the instrument in each role."""
        return {role: driver.identify() for role, driver in self.drivers.items()}

    def state(self) -> dict[str, Any] | None:
        """The state of a simulated bench; None if an instrument is real."""
        if self.world is None or not self.bench.simulated:
            return None
        servers = [server.state() for server in self.servers]
        return {"clock_s": self.clock.now(), "world": self.world.state(), "servers": servers}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore a simulated bench from `state`."""
        clock = self.clock.inner
        if self.world is None or not isinstance(clock, SimulatedClock):
            return
        self.world.restore(state["world"])
        for server, server_state in zip(self.servers, state["servers"], strict=True):
            server.restore(server_state)
        clock.restore(state["clock_s"])

    def tally(self) -> dict[str, tuple[float, str]]:
        """The counters of a digital sensor's driver since the connection, by name: a value with its unit."""
        adc = self.drivers.get("adc")
        return adc.tally() if isinstance(adc, CountsSamples) else {}

    def require_steady(self) -> None:
        """Raises the error of a stage that has left its position, or of an oscillation that has ended."""
        for driver in self._moving_drivers():
            if isinstance(driver, KeepsSteady):
                driver.require_steady()

    def look(self) -> None:
        """Raises the error of an open interlock or an alarm."""
        for driver in self._drivers_with_check():
            driver.look()

    def guarded(self, session: Session) -> AbstractContextManager[None]:
        """Inside the context every wait checks interlocks, alarms and the oven, and raises their errors."""
        checks = [Look(driver.look) for driver in self._drivers_with_check()]
        if "oven" in self.drivers:
            checks.append(
                Look(lambda: session.check_temperature(session.oven.temperature_c()), NOW_AND_THEN_S, OVEN_ANSWER_S)
            )
        return self.clock.guarded(checks)

    def _drivers_with_check(self) -> list[CanLook]:
        """Drivers with interlocks or alarms.

        Without interlocks there is none in simulated time: there the end of a move is early enough for an alarm.
        """
        adc = self.bench.instruments.get("adc")
        if self.bench.simulated and not (adc and adc.parse_settings().interlocks):
            return []
        return [driver for driver in self.drivers.values() if isinstance(driver, CanLook)]

    def release(self) -> list[str]:
        """Switch off the stop inputs that an earlier run left on. Returns a sentence for each.

        A simulated bench needs none: a run begins with new twins, or with those of its last pose.
        """
        if self.bench.simulated:
            return []
        left_on = [
            mover.name for mover in self._moving_drivers() if isinstance(mover, HasStopInput) and mover.release()
        ]
        return [f"{name}: the stop input was still on from an earlier stop; it is off now" for name in left_on]

    def stop(self) -> list[str]:
        """Stop all motion at once, then the oven. Returns a sentence for each instrument that does not stop.

        Every instrument gets its stop command before the first wait. The oven is switched off, because only a run
        checks its temperature.
        """
        movers = self._moving_drivers()
        for mover in movers:
            if isinstance(mover, CanHalt):
                _failure(mover.halt)
        failed = [(mover.name, STILL_MOVES, _failure(cast(Stage, mover).stop)) for mover in movers]
        if (oven := self.drivers.get("oven")) is not None:
            failed.append((oven.name, STILL_HEATS, _failure(lambda: cast(Oven, oven).run(False))))
        return [
            f"{name} {danger}. The command to stop failed: {str(failure).removeprefix(f'{name}: ')}"
            for name, danger, failure in failed
            if failure is not None
        ]

    def _moving_drivers(self) -> list[Driver]:
        """Stages and positioner."""
        return [self.drivers[role] for role in MOVING if role in self.drivers]


def _failure(act: Callable[[], object]) -> Exception | None:
    """The error of `act`. Every error is caught, so that the other instruments are stopped as well."""
    try:
        act()
    except Exception as failure:
        return failure
    return None


def _is_steady(dwells: Sequence[Dwell], oven_c: float) -> bool:
    from rig.results.soak import steady  # slow to import, and only a soak needs it

    return steady(dwells, oven_c)


@contextmanager
def connect_all(bench: Bench, tap: Tap | None = None) -> Iterator[Rig]:
    """The bench with every instrument connected. All wires and servers are closed at the end.

    `tap` is called for every message.
    Raises InstrumentFailed with role, address and remedy; Busy if another process uses a real instrument.
    """
    with open_wires(bench, tap) as wiring:
        drivers = {role: wiring.connect(role) for role in bench.instruments}
        servers = tuple(wiring.servers.values())
        yield Rig(bench, drivers, wiring.clock, wiring.world if servers else None, servers, wiring.links.person)


def check_all(
    bench: Bench, prepare: Callable[[Driver], object] | None = None
) -> dict[str, tuple[Identity | None, list[Check]]]:
    """Identity and self-test of every instrument. One that does not answer has no identity and a failed check.

    `prepare`, if given, is called with each driver before its self-test.
    """
    with open_wires(bench) as wiring:
        return {role: _check(wiring, role, prepare) for role in bench.instruments}


def _check(
    wiring: Wiring, role: str, prepare: Callable[[Driver], object] | None
) -> tuple[Identity | None, list[Check]]:
    try:
        driver = wiring.connect(role)
        if prepare is not None:
            prepare(driver)
        return driver.identify(), driver.self_test()
    except (DriverError, InstrumentFailed) as error:
        return None, [Check("answers", False, str(error))]
