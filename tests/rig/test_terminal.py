"""A person at a terminal: shown what will happen, asked, and able to stop and to go on."""

from __future__ import annotations

import os
import re
import signal
import sys
from collections.abc import Callable
from io import StringIO
from typing import TextIO

import pexpect
import pytest
from rich.console import Console

from rig.cli.terminal.guide import LinePrompt
from rig.record import Record, Run
from rig.runs.observer import NEXT_STEP
from rig.runs.runner import REPEATED
from rig.runs.signals import stoppable
from tests.rig.rigging import POSES, SMALL_ARGUMENTS
from tests.slow import first_fast

pytestmark = pytest.mark.sockets

MENU = f"{re.escape(NEXT_STEP.text)}.*:"
LONG = ("--step-deg", "10", "--dwell-s", "0.2", "--inclinations-deg", "90,45")  # time to press a key
LONG_POSES = 148
UNDER_WAY = rf"deg.*[1-9]\d*/{LONG_POSES} poses"


def at_terminal(*arguments: str) -> pexpect.spawn[str]:
    """Ctrl-C makes the terminal drop what it has not shown yet, in the middle of a character too: hence `replace`."""
    words = ["-m", "rig", *arguments]
    return pexpect.spawn(
        sys.executable, words, encoding="utf-8", codec_errors="replace", timeout=30, dimensions=(60, 120)
    )


def begun(*settings: str) -> pexpect.spawn[str]:
    """A sweep that a person has begun."""
    terminal = at_terminal("run", "sweep", *settings)
    terminal.expect("Begin.*:")
    terminal.sendline("go")
    terminal.expect("Is the sensor mounted face up.*:")
    terminal.sendline("yes")
    return terminal


def press_ctrl_c(terminal: pexpect.spawn[str]) -> None:
    terminal.sendintr()
    terminal.expect("stopped by a person")


def only_run() -> tuple[Run, list[str | None]]:
    """The one run of the record, and which of its poses are excluded, and why."""
    with Record() as record:
        (run,) = record.runs()
        return run, [kept.excluded for kept in record.kept(run.run)]


@pytest.mark.slow
def test_a_guided_run_asks_shows_and_ends() -> None:
    """A refusal is no end."""
    with at_terminal("run", "sweep", *SMALL_ARGUMENTS) as terminal:
        terminal.expect("Check by hand")
        terminal.expect("drawings/mounting.svg")
        terminal.expect("Begin.*:")
        terminal.sendline("go")
        terminal.expect("Is the sensor mounted face up.*:")
        terminal.sendline("perhaps")
        terminal.expect("answer with yes or no")
        terminal.sendline("no")
        terminal.expect("is no; correct this")
        terminal.expect(MENU)
        terminal.sendline("resume")
        terminal.expect("Is the sensor mounted face up.*:")
        terminal.sendline("yes")
        terminal.expect(f"{POSES}/{POSES}")
        terminal.expect(f"complete, {POSES} poses")
        terminal.expect(pexpect.EOF)
    assert terminal.exitstatus == 0
    with Record() as record:
        (run,) = record.runs()
        assert [event.text for event in record.events(run.run)][-1] == "yes"


def test_a_cancelled_run_leaves_nothing() -> None:
    with at_terminal("run", "sweep", *SMALL_ARGUMENTS) as terminal:
        terminal.expect("Begin.*:")
        terminal.sendline("cancel")
        terminal.expect("nothing moved and nothing was recorded")
        terminal.expect(pexpect.EOF)
    assert terminal.exitstatus == 4
    with Record() as record:
        assert record.runs() == []


@pytest.mark.slow
@pytest.mark.parametrize(("wish", "excluded"), [("repeat", [REPEATED]), ("resume", [])])
def test_ctrl_c_stops_a_run_and_a_person_continues_it(wish: str, excluded: list[str]) -> None:
    with begun(*LONG) as terminal:
        terminal.expect(UNDER_WAY)
        press_ctrl_c(terminal)
        terminal.expect(MENU)
        assert only_run()[0].state == "stopped"
        terminal.sendline(wish)
        terminal.expect(f"complete, {LONG_POSES + len(excluded)} poses", timeout=120)
        terminal.expect(pexpect.EOF)
    assert terminal.exitstatus == 0
    run, reasons = only_run()
    assert (run.state, [reason for reason in reasons if reason]) == ("complete", excluded)


def end_it(terminal: pexpect.spawn[str]) -> None:
    terminal.sendline("end")


ENDS: dict[str, Callable[[pexpect.spawn[str]], object]] = {
    "end": end_it,
    "ctrl-c": pexpect.spawn.sendintr,
    "ctrl-d": pexpect.spawn.sendeof,
    "sigterm": lambda terminal: terminal.kill(signal.SIGTERM),
}


@pytest.mark.slow
@pytest.mark.parametrize("end", first_fast(ENDS))
def test_the_menu_ends_a_run_that_can_be_resumed(end: str) -> None:
    with begun(*LONG) as terminal:
        terminal.expect(UNDER_WAY)
        press_ctrl_c(terminal)
        terminal.expect(MENU)
        ENDS[end](terminal)
        terminal.expect("`rig resume .*` continues the run")
        terminal.expect(pexpect.EOF)
    assert terminal.exitstatus == 4
    run, _ = only_run()
    assert run.state == "stopped"
    assert 0 < run.rows < LONG_POSES


@pytest.mark.slow
def test_sigterm_ends_a_guided_run_without_a_menu() -> None:
    with begun(*LONG) as terminal:
        terminal.expect(UNDER_WAY)
        terminal.kill(signal.SIGTERM)
        terminal.expect("stopped by another program")
        terminal.expect(pexpect.EOF)
        assert NEXT_STEP.text not in (terminal.before or "")
    assert terminal.exitstatus == 4
    assert only_run()[0].state == "stopped"


def test_a_question_reads_the_terminal_only_when_a_line_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """A signal just before a read that blocks would wait for the next line."""
    person, terminal = os.openpty()
    waits: list[float] = []

    def nobody_typed_twice(files: list[TextIO], _write: object, _error: object, wait_s: float) -> list[list[TextIO]]:
        waits.append(wait_s)
        return [files if len(waits) > 2 else [], [], []]

    monkeypatch.setattr("select.select", nobody_typed_twice)
    monkeypatch.setattr("builtins.input", lambda: f"after {len(waits)} waits")
    shown = StringIO()
    with os.fdopen(person, "rb", 0), os.fdopen(terminal) as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        answer = LinePrompt.ask("Begin?", console=Console(file=shown))
    assert answer == "after 3 waits"
    assert max(waits) <= 0.2
    assert shown.getvalue().startswith("Begin?")


def test_a_signal_ends_a_question_while_it_waits_for_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """Elsewhere in the code of the screen a signal waits."""
    person, terminal = os.openpty()
    waits: list[float] = []

    def stopped(files: list[TextIO], _write: object, _error: object, wait_s: float) -> list[list[TextIO]]:
        waits.append(wait_s)
        if len(waits) == 1:
            signal.raise_signal(signal.SIGINT)
        return [files, [], []]

    monkeypatch.setattr("select.select", stopped)
    monkeypatch.setattr("builtins.input", lambda: pytest.fail("the question went on"))
    with os.fdopen(person, "rb", 0), os.fdopen(terminal) as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        with stoppable(), pytest.raises(KeyboardInterrupt, match="SIGINT"):
            LinePrompt.ask("Begin?", console=Console(file=StringIO()))


def test_a_question_reads_a_pipe_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its lines may be in a buffer of Python, which `select` does not see."""
    monkeypatch.setattr("select.select", lambda *_: pytest.fail("it waits"))
    monkeypatch.setattr("sys.stdin", StringIO("no\n"))
    assert LinePrompt.ask("Begin?", console=Console(file=StringIO())) == "no"
