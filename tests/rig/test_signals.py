"""A signal ends a run once; a terminal that closes does not end what nohup started."""

import signal
from threading import Event
from types import FunctionType

import pytest

from rig.signals import SIGNALS, stoppable


def twice(number: signal.Signals) -> None:
    try:
        signal.raise_signal(number)
    finally:
        signal.raise_signal(number)


@pytest.mark.parametrize("number", SIGNALS)
def test_the_first_signal_interrupts_and_further_ones_are_quiet(number: signal.Signals) -> None:
    before = [signal.getsignal(each) for each in SIGNALS]
    with pytest.raises(KeyboardInterrupt, match=number.name), stoppable():
        twice(number)
    assert [signal.getsignal(each) for each in SIGNALS] == before


def test_nohup_is_respected() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stoppable():
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


def test_the_simulated_worlds_compiled_code_is_not_interrupted() -> None:
    def compute() -> str:
        signal.raise_signal(signal.SIGINT)
        return "whole"

    world = {"signal": signal, "__name__": "drivers.simulation.world"}
    computed: list[str] = []

    def compute_and_wait() -> None:
        computed.append(FunctionType(compute.__code__, world)())
        Event().wait(30)  # the signal ends it

    with pytest.raises(KeyboardInterrupt, match="SIGINT"), stoppable():
        compute_and_wait()
    assert computed == ["whole"]
