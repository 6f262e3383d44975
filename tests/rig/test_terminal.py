"""A person at a terminal: asked, shown, and able to stop."""

from __future__ import annotations

import sys

import pexpect
import pytest

from rig.record import Record
from tests.rig.rigging import POSES, SMALL_ARGUMENTS

pytestmark = pytest.mark.sockets


def at_terminal(*arguments: str) -> pexpect.spawn[str]:
    return pexpect.spawn(sys.executable, ["-m", "rig", *arguments], encoding="utf-8", timeout=30, dimensions=(40, 120))


def test_a_guided_run_asks_shows_and_ends() -> None:
    with at_terminal("run", "sweep", *SMALL_ARGUMENTS) as terminal:
        terminal.expect("Is the sensor mounted face up.*:")
        terminal.sendline("perhaps")
        terminal.expect("it takes yes or no")
        terminal.sendline("yes")
        terminal.expect(f"{POSES}/{POSES}")
        terminal.expect(f"complete, {POSES} poses")
        terminal.expect(pexpect.EOF)
    assert terminal.exitstatus == 0
    with Record() as record:
        (run,) = record.runs()
        assert [event.text for event in record.events(run.run)] == ["yes"]


def test_ctrl_c_at_a_question_leaves_a_run_that_can_be_resumed() -> None:
    with at_terminal("run", "sweep", *SMALL_ARGUMENTS) as terminal:
        terminal.expect("Is the sensor mounted face up.*:")
        terminal.sendintr()
        terminal.expect("rig resume .* goes on where it was")
        terminal.expect(pexpect.EOF)
    assert terminal.exitstatus == 4
    with Record() as record:
        assert [run.state for run in record.runs()] == ["stopped"]
