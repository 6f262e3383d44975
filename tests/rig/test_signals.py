"""A signal ends a run once; a terminal that closes does not end what nohup started."""

import inspect
import signal
import sys
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from threading import Event
from types import FunctionType
from typing import Any

import pytest

from drivers.transport.link import OpenConnection
from rig.runs.signals import COUNTERS, FLEET_STARTS, QUESTIONS, SIGNALS, stoppable


def twice(number: signal.Signals) -> None:
    try:
        signal.raise_signal(number)
    finally:
        signal.raise_signal(number)


@pytest.fixture(autouse=True)
def not_ignored() -> Iterator[None]:
    """SIGHUP ends a program, also where these tests run under nohup."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize("number", SIGNALS)
def test_the_first_signal_interrupts_and_further_ones_are_quiet(number: signal.Signals) -> None:
    before = [signal.getsignal(each) for each in SIGNALS]
    with pytest.raises(KeyboardInterrupt, match=number.name), stoppable():
        twice(number)
    assert [signal.getsignal(each) for each in SIGNALS] == before


def test_a_signal_that_nohup_ignores_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stoppable():
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


class Interrupted:
    """A port whose bytes come with a signal."""

    chunk, lossy, key = 1, False, "port"

    def fileno(self) -> int:
        return 0

    def read(self) -> bytes:
        signal.raise_signal(signal.SIGINT)
        return b"abc"

    def write(self, data: bytes) -> int:
        signal.raise_signal(signal.SIGINT)
        return len(data)

    def close(self) -> None: ...


@pytest.mark.parametrize("use", [OpenConnection.take, lambda line: line.put(b"abc")], ids=["read", "write"])
def test_a_signal_waits_until_bytes_are_counted(use: Callable[[OpenConnection], object]) -> None:
    line = OpenConnection(Interrupted())

    def use_and_wait() -> None:
        use(line)
        Event().wait(30)  # the signal ends it

    with pytest.raises(KeyboardInterrupt), stoppable():
        use_and_wait()
    assert line.received + line.sent == 3


class Forgotten:
    """What a signal comes into as it is forgotten, where Python hands no exception on."""

    def __del__(self) -> None:
        signal.raise_signal(signal.SIGTERM)


def test_a_signal_during_a_finaliser_is_not_lost() -> None:
    hook = sys.unraisablehook

    def forget_and_wait() -> None:
        Forgotten()
        Event().wait(30)  # the signal ends it

    begun_s = time.monotonic()
    with pytest.raises(KeyboardInterrupt, match="SIGTERM"), stoppable():
        forget_and_wait()
    assert time.monotonic() - begun_s < 10, "the signal was lost"
    assert sys.unraisablehook is hook


def test_other_discarded_exceptions_go_to_the_earlier_hook(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda what: told.append(what.exc_value))

    class Faulty:
        def __del__(self) -> None:
            raise ValueError("a fault")

    with stoppable():
        Faulty()
    assert [str(error) for error in told] == ["a fault"]


def signalled_in(module: str, name: str) -> list[str]:
    """What became of a function of this name and module that a signal comes into; afterwards the signal is heard."""

    def compute() -> None:
        signal.raise_signal(signal.SIGINT)
        done.append("whole")

    done: list[str] = []
    namespace = {"signal": signal, "__name__": module}
    function = FunctionType(compute.__code__.replace(co_name=name), namespace, closure=compute.__closure__)

    def compute_and_wait() -> None:
        function()
        Event().wait(30)  # the signal ends it

    begun_s = time.monotonic()
    with pytest.raises(KeyboardInterrupt, match="SIGINT"), stoppable():
        compute_and_wait()
    assert time.monotonic() - begun_s < 10, "the signal does not wake who waits"
    return done


@pytest.mark.parametrize(
    ("module", "name"),
    [
        ("drivers.world.world", "advance"),
        ("rich.console", "print"),
        ("rich.live", "start"),
        ("drivers.clock", "step"),
        ("drivers.transport.link", "put"),
        ("drivers.transport.link", "take"),
        ("rig.fleet.cluster", "start_cluster"),
        ("rig.fleet.cluster", "start_client"),
    ],
)
def test_indivisible_code_is_not_interrupted(module: str, name: str) -> None:
    assert signalled_in(module, name) == ["whole"]


def test_a_delayed_signal_is_repeated_until_it_is_received() -> None:
    """A wait that begins between a signal of the timer and its handler would hear none otherwise."""
    repeated_s: list[float] = []

    def take() -> None:
        signal.raise_signal(signal.SIGINT)
        repeated_s.append(signal.getitimer(signal.ITIMER_REAL)[1])

    namespace = {"signal": signal, "__name__": "drivers.transport.link"}
    take_bytes = FunctionType(take.__code__, namespace, closure=take.__closure__)

    def take_and_wait() -> None:
        take_bytes()
        Event().wait(30)  # the signal ends it

    with stoppable():
        with pytest.raises(KeyboardInterrupt, match="SIGINT"):
            take_and_wait()
        assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0), "the stop would be disturbed"
    assert 0 < repeated_s[0] < 0.1


@pytest.mark.parametrize(("module", "name"), [*COUNTERS, *FLEET_STARTS, *QUESTIONS])
def test_the_functions_in_which_a_signal_is_special_have_these_names(module: str, name: str) -> None:
    assert f"def {name}(" in inspect.getsource(import_module(module))


@pytest.mark.parametrize(
    ("module", "name"), [("rich.console", "input"), ("richer", "print"), ("rig.runs.runner", "run")]
)
def test_every_wait_for_a_person_can_be_stopped(module: str, name: str) -> None:
    assert signalled_in(module, name) == []


def delay_a_signal() -> None:
    """A signal during a computation of the simulated world, which waits for the timer."""
    code = (lambda: signal.raise_signal(signal.SIGINT)).__code__
    FunctionType(code, {"signal": signal, "__name__": "drivers.world.world"})()


def test_a_signal_that_waits_and_a_further_one_stop_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second exception would interrupt the stop of the instruments."""
    monkeypatch.setattr("rig.runs.signals.AGAIN_S", 3600.0)
    stopped: list[str] = []

    def stop_while_a_signal_waits() -> None:
        delay_a_signal()
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            signal.raise_signal(signal.SIGALRM)  # the timer ends: to this thread, whatever other threads there are
            stopped.append("at rest")

    with pytest.raises(KeyboardInterrupt), stoppable():
        stop_while_a_signal_waits()
    assert stopped == ["at rest"]


def test_a_signal_while_the_handlers_are_set_leaves_the_earlier_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    before = [signal.getsignal(each) for each in (*SIGNALS, signal.SIGALRM)]
    set_handler, raised = signal.signal, list[int]()

    def set_and_raise(number: int, handler: Any) -> Any:
        earlier = set_handler(number, handler)
        if number == signal.SIGINT and not raised:
            raised.append(number)
            signal.raise_signal(signal.SIGINT)
        return earlier

    monkeypatch.setattr(signal, "signal", set_and_raise)
    with pytest.raises(KeyboardInterrupt), stoppable():
        pass
    assert [signal.getsignal(each) for each in (*SIGNALS, signal.SIGALRM)] == before
