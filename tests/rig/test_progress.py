"""Work that takes longer than a second shows its progress on standard error, and nothing of it elsewhere."""

from __future__ import annotations

import io
import re
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from rig.cli.terminal import compiling, progress
from rig.cli.terminal.output import note
from tests.rig.conftest import Rig


class Stream(io.StringIO):
    """Standard error, a terminal or a pipe."""

    def __init__(self, terminal: bool) -> None:
        super().__init__()
        self.terminal = terminal

    def isatty(self) -> bool:
        return self.terminal


class Seconds:
    """An end of work that comes after some seconds; `begins` is called in each of them with its number."""

    def __init__(self, count: int, begins: Callable[[int], None] = lambda second: None) -> None:
        self.count, self.second, self.begins = count, 0, begins

    def wait(self, timeout: float) -> bool:
        assert timeout == progress.EVERY_S
        self.second += 1
        self.begins(self.second)
        return self.second > self.count


def shown(
    terminal: bool,
    monkeypatch: pytest.MonkeyPatch,
    seconds: int = 2,
    begins: Callable[[progress.Progress, int], None] = lambda work, second: None,
) -> str:
    """Standard error after some seconds of work and a remark."""
    stream, work = Stream(terminal), progress.Progress("searching", 0.5)
    monkeypatch.setattr(sys, "stderr", stream)
    progress._show(work, stream, terminal, Seconds(seconds, partial(begins, work)))
    note("a remark")
    return stream.getvalue()


def test_a_pipe_receives_plain_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """After 1, 11, 21 and 31 seconds."""
    lines = shown(False, monkeypatch, 35).splitlines()
    assert [("searching" in line) for line in lines] == [True, True, True, True, False]
    assert not any(sign in "".join(lines) for sign in "\r\x1b")


def test_a_pipe_receives_a_line_in_each_second_in_which_the_work_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    def begins(work: progress.Progress, second: int) -> None:
        if second in (3, 4, 7):
            work.text = f"effect {second}"
        if second == 9:
            work.share = 0.75

    *lines, remark = shown(False, monkeypatch, 12, begins).splitlines()
    assert remark == "a remark"
    assert [re.sub(r".*%  |, .*", "", line) for line in lines] == [
        "searching",
        "effect 3",
        "effect 4",
        "effect 7",
        "effect 7",
    ]
    assert " 75 %" in lines[-1]


def test_a_terminal_shows_one_line_that_a_remark_replaces(monkeypatch: pytest.MonkeyPatch) -> None:
    text = shown(True, monkeypatch)
    assert text.count("searching") == 2
    assert text.count("\n") == 1
    assert text.endswith(f"{progress.ERASE}a remark\n")
    assert not text.partition("a remark")[2].strip()


def test_short_work_shows_no_progress(capsys: pytest.CaptureFixture[str]) -> None:
    with progress.working("searching"):
        pass
    assert capsys.readouterr().err == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("compare", "good.csv"), "fitting the model: "),
        (("fit", "good.csv"), "fitting the model: "),
        (("diagnose", "good.csv"), "searching for missing effects. "),
        (("discover", "good.csv"), "searching for missing effects. "),
        (
            ("add", "quadratic-nonlinearity", "--model", "linear", "--data", "good.csv", "--out", "q.yaml"),
            "searching for missing effects. ",
        ),
        (("report", "good.csv", "--out", "r.html", "--force"), "fitting the model and searching for missing effects: "),
        (("certificate", "good.csv", "--model", "linear", "--out", "c.pdf", "--force"), "fitting the model: "),
        (("plan", "sweep", "--optimal"), "choosing the poses: "),
        (("import", "good.csv"), "storing good.csv: "),
    ],
)
def test_a_command_shows_its_present_step(
    words: tuple[str, ...], says: str, rig: Rig, work: Path, undrawn: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    quiet = rig(*words)
    (work / "q.yaml").unlink(missing_ok=True)
    monkeypatch.setattr(progress, "EVERY_S", 1e-3)
    ended = rig(*words, *(("--json",) if words[0] == "compare" else ()))
    assert ended.status == quiet.status == 0
    assert says not in quiet.err + ended.out
    assert any(line.startswith(says) for line in ended.err.splitlines()), ended.err


COMPILED = """
from rig.cli.terminal.compiling import say_when_compiling
say_when_compiling()
import numba
import calibrations.criteria
for function in (lambda x: x + 1, lambda x: x + 2):
    numba.njit(function)(1)
"""


def test_a_command_that_compiles_prints_one_line() -> None:
    ended = subprocess.run([sys.executable, "-c", COMPILED], capture_output=True, text=True, timeout=60, check=True)
    assert (ended.stdout, ended.stderr.splitlines()) == ("", [compiling.TEXT])
