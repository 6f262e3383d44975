"""SIGTERM comes at any wait of a run, in a move, in a stream, in a pause or while asking: all stands still, exit 4."""

from __future__ import annotations

import signal
from collections.abc import Callable
from typing import Any

import pytest

from drivers.clock import SimulatedClock
from procedures.questions import Question
from rig.bench import read_bench
from rig.cli.terminal.failure import status_of
from rig.record import Record
from rig.runs.runner import resume, start
from tests.rig.misbehaving import SHORT, STRETCHES, digest, looking_on, short
from tests.rig.rigging import Onlooker, small_sweep
from tests.slow import first_fast

pytestmark = pytest.mark.sockets


class Asked(Onlooker):
    """A signal comes while a question waits for its answer."""

    def ask(self, question: Question, instead: str | None) -> str:
        signal.raise_signal(signal.SIGTERM)
        return super().ask(question, instead)


@pytest.fixture
def signal_at(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, int], list[int]]:
    """Send SIGTERM at the `number`-th call of a method of the simulated clock; gives the calls so far."""

    def arrange(method: str, number: int) -> list[int]:
        calls, sent, wait = [0], list[int](), getattr(SimulatedClock, method)

        def waited(*arguments: Any) -> Any:
            calls[0] += callable(signal.getsignal(signal.SIGTERM))  # not in a plan, which nothing needs to end
            if calls[0] == number and not sent:
                sent.append(number)
                signal.raise_signal(signal.SIGTERM)
            return wait(*arguments)

        monkeypatch.setattr(SimulatedClock, method, waited)
        return calls

    return arrange


FAST = ("misalignment", "noise-floor", "sweep")  # the others take longer, on the same way
OTHERS = sorted(SHORT.keys() - {"motion", "repeat", *FAST})


@pytest.mark.parametrize("procedure", first_fast((*FAST, *OTHERS), len(FAST)))
@pytest.mark.parametrize(("method", "share"), first_fast([("sleep", 0.4), ("wait_readable", 0.7)]))
def test_a_signal_is_received_wherever_a_run_waits(
    procedure: str, method: str, share: float, signal_at: Callable[[str, int], list[int]]
) -> None:
    with Record() as record:
        calls = signal_at(method, -1)
        whole = digest(record, short(record, read_bench(), procedure).run.run)
        signal_at(method, int(share * calls[0]))
        with looking_on() as aftermath:
            outcome = short(record, read_bench(), procedure)
        assert outcome.run.state == "stopped"
        assert outcome.error
        assert str(outcome.error).startswith("stopped by another program; `rig resume ")
        assert status_of(outcome.error) == 4
        assert (aftermath.turning, aftermath.heating, aftermath.complaints) == ([], False, [])
        found = digest(record, resume(record, outcome.run.run, Onlooker()).run.run)
        assert len(found) == len(whole)
        assert found == whole or procedure in STRETCHES


def test_a_signal_is_received_while_a_run_asks() -> None:
    with Record() as record, looking_on() as aftermath:
        outcome = start(record, read_bench(), *small_sweep(), Asked())
        assert (outcome.run.state, outcome.run.rows, aftermath.stops) == ("stopped", 0, 1)
        assert status_of(outcome.error or Exception()) == 4
        assert resume(record, outcome.run.run, Onlooker()).run.state == "complete"
