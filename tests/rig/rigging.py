"""A small sweep, somebody who looks on, and a command in a process of its own that comes to harm."""

from __future__ import annotations

import itertools
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import Engine, event

from procedures.catalogue import find, paths
from procedures.questions import Question
from procedures.session import Guidance, Reading
from procedures.settings import parse
from rig.planning.plan import Plan
from rig.record import KeptPose
from rig.runs.runner import Decision, Observer, Outcome

SMALL = {"step_deg": "90", "dwell_s": "0.2", "inclinations_deg": "90,45"}
SMALL_ARGUMENTS = ("--step-deg", "90", "--dwell-s", "0.2", "--inclinations-deg", "90,45")
POSES = 20  # of the small sweep
ON_STAGES = sorted(name for name in paths() if not name.startswith("hand-"))  # what the simulated rig can run


def small_sweep() -> tuple[Any, dict[str, Any]]:
    """The procedure and its settings."""
    sweep = find("sweep")
    return sweep, parse(sweep, SMALL)


@dataclass
class Onlooker(Observer):
    """Remembers what it was shown; leaves every answer to the simulated technician.

    What it wishes where the run is interrupted is given in order; then it wishes the end.
    """

    run: str = ""
    said: list[str] = field(default_factory=list)
    expected: list[tuple[int, int]] = field(default_factory=list)
    seen: list[KeptPose] = field(default_factory=list)
    wishes: list[Decision] = field(default_factory=list)
    outcomes: list[Outcome] = field(default_factory=list)
    plan: Plan | None = None

    def planned(self, plan: Plan) -> None:
        self.plan = plan

    def begun(self, run: str) -> None:
        self.run = run

    def doing(self, text: str) -> None:
        self.said.append(text)

    def guide(self, guidance: Guidance) -> None:
        self.said.append(guidance.text)

    def expect(self, total: int, done: int) -> None:
        self.expected.append((total, done))

    def kept(self, kept: KeptPose) -> None:
        self.seen.append(kept)

    def read(self, reading: Reading) -> None:
        self.said.append(f"{reading.name} read")

    def ask(self, question: Question, instead: str | None) -> str:
        self.said.append(f"{question.name}: {question.text}")
        assert instead is not None
        return instead

    def interrupted(self, outcome: Outcome) -> Decision:
        self.outcomes.append(outcome)
        return self.wishes.pop(0) if self.wishes else "end"


def in_own_process(*arguments: str, harm: str = "") -> subprocess.CompletedProcess[str]:
    """Call a command in a process of its own, after the Python statements `harm`."""
    program = f"{harm}\nfrom rig.cli import main\nmain({list(arguments)!r})"
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)


def signal_at(table: str, number: int, name: str) -> str:
    """Statements that send the own process a signal inside a transaction: at its insert `number` into `table`."""
    return f"""
import itertools, os, signal
from sqlalchemy import Engine, event
inserts = itertools.count(1)
@event.listens_for(Engine, "before_cursor_execute")
def harm(connection, cursor, statement, *more):
    if statement.startswith("INSERT INTO {table} ") and next(inserts) == {number}:
        os.kill(os.getpid(), signal.{name})
"""


@contextmanager
def sigterm_at(pose: int) -> Iterator[None]:
    """The signal comes inside a transaction, as that pose is written."""
    inserts = itertools.count(1)

    def harm(connection: Any, cursor: Any, statement: str, *more: Any) -> None:
        if statement.startswith("INSERT INTO poses ") and next(inserts) == pose:
            signal.raise_signal(signal.SIGTERM)

    event.listen(Engine, "before_cursor_execute", harm)
    try:
        yield
    finally:
        event.remove(Engine, "before_cursor_execute", harm)
