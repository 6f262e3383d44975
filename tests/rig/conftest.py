"""A small sweep, a command called in this process, and a command in a process of its own that comes to harm."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from rig.cli import main
from rig.record import Kept

SMALL = {"step_deg": "90", "dwell_s": "0.2", "inclinations_deg": "90,45"}  # 20 poses
SMALL_ARGS = ("sweep", "--step-deg", "90", "--dwell-s", "0.2", "--inclinations-deg", "90,45")
POSES = 20


@dataclass
class Onlooker:
    """Remembers what it was shown; answers every question by its default."""

    run: str = ""
    said: list[str] = field(default_factory=list)
    expected: list[tuple[int, int]] = field(default_factory=list)
    seen: list[Kept] = field(default_factory=list)

    def begun(self, run: str) -> None:
        self.run = run

    def doing(self, text: str) -> None:
        self.said.append(text)

    def expect(self, total: int, done: int) -> None:
        self.expected.append((total, done))

    def kept(self, kept: Kept) -> None:
        self.seen.append(kept)

    def ask(self, name: str, question: str, default: str) -> str:
        self.said.append(question)
        return default


@pytest.fixture()
def onlooker() -> Onlooker:
    return Onlooker()


@dataclass(frozen=True)
class Ended:
    status: int
    out: str
    err: str


@pytest.fixture()
def rig(capsys: pytest.CaptureFixture[str]) -> Callable[..., Ended]:
    """Call a command in this process."""

    def call(*arguments: str) -> Ended:
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        shown = capsys.readouterr()
        return Ended(int(ended.value.code or 0), shown.out, shown.err)

    return call


def in_own_process(*arguments: str, harm: str = "") -> subprocess.CompletedProcess[str]:
    """Call a command in a process of its own, after the Python statements `harm`."""
    program = f"{harm}\nfrom rig.cli import main\nmain({list(arguments)!r})"
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)


def harm_at_commit(number: int, signal_name: str) -> str:
    """Statements that send the own process a signal inside the transaction `number` from now."""
    return f"""
import itertools, os, signal
from sqlalchemy import Engine, event
commits = itertools.count(1)
@event.listens_for(Engine, "commit")
def harm(connection):
    if next(commits) == {number}:
        os.kill(os.getpid(), signal.{signal_name})
"""


@pytest.fixture()
def bench_file(tmp_path: Path) -> Callable[[Mapping[str, object] | str], Path]:
    """Write a bench file: the simulated rig with changes at the top level, or a text as it is."""
    import yaml

    from rig.bench import DEFAULT

    def write(changes: Mapping[str, object] | str) -> Path:
        path = tmp_path / "bench.yaml"
        text = changes if isinstance(changes, str) else yaml.safe_dump(yaml.safe_load(DEFAULT.read_text()) | dict(changes))
        path.write_text(text, encoding="utf-8")
        return path

    return write
