"""While anything waits, interlocks, alarms and the oven are looked at, and what is found stops all that moves."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import patch

import pytest

from drivers.errors import DriverError, OverTemperature
from drivers.oriental_az import registers as az
from drivers.oriental_az.twin import Drive
from drivers.transport.faults import Fault
from rig.cli.terminal.failure import status_of
from rig.instruments.guard import WATCH_S, GuardedClock, Look
from rig.record import Record
from rig.runs.runner import resume
from rig.web.server import _listen
from tests.rig.misbehaving import afflicted, digest, guarded_bench, looking_on, short, watched_bench
from tests.rig.rigging import Onlooker

TINY = {"inclinations_deg": "90"}
LATEST_S = 0.1  # from a fault to the stop command on the wire


class FakeClock:
    """Time that only sleeping moves."""

    def __init__(self) -> None:
        self.now_s, self.slept = 0.0, 0

    def now(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.slept += 1
        self.now_s += max(0.0, seconds)

    def wait_readable(self, wire: object, timeout_s: float) -> bool:
        return False


def test_a_sleep_calls_the_checks_and_ends_on_time() -> None:
    clock, seen = GuardedClock(FakeClock()), []
    with clock.guarded([Look(lambda: seen.append(clock.now()))]):
        clock.sleep(1.0)
        clock.sleep(0.001)
        assert clock.now() == pytest.approx(1.001)
    assert seen == pytest.approx([WATCH_S * k for k in range(1, 25)])
    clock.sleep(1.0)
    assert len(seen) == 24


def test_many_short_sleeps_have_the_checks_of_one_long_sleep() -> None:
    clock, seen = GuardedClock(FakeClock()), []
    with clock.guarded([Look(lambda: seen.append(clock.now()))]):
        while clock.now() < 1.0:
            clock.sleep(0.021)
    assert seen == pytest.approx([WATCH_S * k for k in range(1, 26)])


def test_a_sleep_within_an_exchange_calls_no_check() -> None:
    clock, seen = GuardedClock(FakeClock()), []
    with clock.guarded([Look(lambda: seen.append(1), every_s=0.001)]):
        for _ in range(100):
            clock.sleep(0.002)
    assert not seen


def test_a_check_that_waits_does_not_start_another_check() -> None:
    clock, depth, deepest = GuardedClock(FakeClock()), 0, 0

    def look() -> None:
        nonlocal depth, deepest
        depth += 1
        deepest = max(deepest, depth)
        clock.sleep(0.02)
        depth -= 1

    with clock.guarded([Look(look)]):
        clock.sleep(1.0)
    assert deepest == 1


def test_a_check_that_takes_time_waits_for_a_long_sleep() -> None:
    clock, seen = GuardedClock(FakeClock()), []
    with clock.guarded([Look(lambda: seen.append(clock.now()), every_s=1.0, takes_s=0.5)]):
        for _ in range(10):
            clock.sleep(0.4)
        assert not seen
        clock.sleep(1.6)
    assert seen == [pytest.approx(5.0)]


def test_the_error_of_a_check_is_raised_once() -> None:
    clock = GuardedClock(FakeClock())

    def look() -> None:
        if clock.now() > 0.33:
            raise ZeroDivisionError

    with clock.guarded([Look(look)]):
        with pytest.raises(ZeroDivisionError):
            clock.sleep(10.0)
        stopped_s = clock.now()
        clock.sleep(1.0)  # as a driver does that brakes before it passes the error on
    assert stopped_s == pytest.approx(0.36)


@contextmanager
def stops() -> Iterator[list[float]]:
    """When stop commands arrive at drives that move, s."""
    told: list[float] = []
    inputs = Drive._inputs

    def listening(drive: Drive, rising: int, now_s: float) -> None:
        if rising & az.STOP:
            told.append(now_s)
        inputs(drive, rising, now_s)

    with patch.object(Drive, "_inputs", listening):
        yield told


FOUND = [  # what is noticed while something else is waited for
    ("adc", Fault("open-interlock", at_s=26.6), 4, "adc: the interlock e-stop (DIO4) is open. Release the emergency"),
    ("adc", Fault("open-interlock", at_s=24.0, size=5), 4, "adc: the interlock door (DIO5) is open."),
    ("alpha", Fault("alarm", at_s=20.0), 3, "alpha: has stopped with alarm 30, overload."),
    ("beta", Fault("alarm", at_s=25.3), 3, "beta: has stopped with alarm 30, overload."),
]


@pytest.mark.sockets
@pytest.mark.parametrize(("role", "fault", "status", "said"), FOUND)
def test_a_stop_is_on_the_wire_within_a_tenth_of_a_second(role: str, fault: Fault, status: int, said: str) -> None:
    with Record() as record, stops() as told, looking_on() as aftermath:
        outcome = short(record, afflicted(guarded_bench(), role, fault), "sweep", **TINY)
        assert outcome.error
        assert said in str(outcome.error)
        assert status_of(outcome.error) == status
        assert outcome.run.state == ("stopped" if status == 4 else "failed")
        assert 0 <= told[0] - fault.at_s <= LATEST_S
        assert (aftermath.turning, aftermath.complaints) == ([], [])


@pytest.mark.slow
@pytest.mark.sockets
def test_a_run_stopped_by_an_interlock_continues_and_equals_an_undisturbed_run() -> None:
    bench = guarded_bench()
    with Record() as record:
        stopped = short(record, afflicted(bench, "adc", Fault("open-interlock", at_s=26.6)), "sweep", **TINY)
        assert stopped.error
        assert resume(record, stopped.run.run, Onlooker(), bench).run.state == "complete"
        assert digest(record, stopped.run.run) == digest(record, short(record, bench, "sweep", **TINY).run.run)


@pytest.mark.sockets
def test_a_run_does_not_begin_while_an_interlock_is_open() -> None:
    with Record() as record, stops():
        outcome = short(record, afflicted(guarded_bench(), "adc", Fault("open-interlock")), "sweep")
        assert isinstance(outcome.error, DriverError)
        assert "is open" in str(outcome.error)
        assert outcome.run.rows == 0
        assert record.state(outcome.run.run) is None, "it was not even homed"


@pytest.mark.sockets
def test_an_oven_above_its_limit_is_noticed_while_the_run_waits() -> None:
    """Half an hour of soaking: the heater is off when it has become too hot, not at the end."""
    with Record() as record, looking_on() as aftermath:
        bench = afflicted(watched_bench(), "oven", Fault("runaway", at_s=100.0))
        outcome = short(record, bench, "temperature-cycle", soak_s="1800")
        assert status_of(outcome.error or Exception()) == 4
        assert not isinstance(outcome.error, OverTemperature), "the sensor's limit comes before the oven's"
        assert "the sensor is at 85." in str(outcome.error)
        assert not aftermath.heating


def test_two_servers_that_start_at_once_listen_on_different_ports() -> None:
    """Neither has accepted a connection yet when the other binds."""
    with _listen("127.0.0.1", None)[0] as first, _listen("127.0.0.1", None)[0] as second:
        assert first.getsockname()[1] != second.getsockname()[1]
