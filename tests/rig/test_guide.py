"""The guided terminal: what a person sees, and is asked."""

from __future__ import annotations

import io

import numpy as np
import pytest
from rich.console import Console

from procedures.errors import NoAnswer
from procedures.questions import Confirm, Number
from procedures.session import Pose
from rig.cli.guide import Guide
from rig.cli.output import columns, duration, size
from rig.cli.watch import Quiet, watching
from rig.record import Block, Kept


def kept(number: int) -> Kept:
    block = Block(np.array([[2.4, 2.5], [2.6, 2.5]]), ("vx", "vy"), 1000.0, 0.0)
    return Kept(Pose(90, 10.0 * number, 1), block, 3600.0, 28.3)


def test_it_shows_what_happens_progress_readings_and_time() -> None:
    screen = io.StringIO()
    with Guide("sweep", {}, Console(file=screen, force_terminal=True, width=120)) as guide:
        guide.begun("20261121-093012-sweep-a1b")
        guide.expect(4, 1)
        guide.doing("moving to alpha 90, beta 10 deg")
        guide.kept(kept(1))
    shown = screen.getvalue()
    assert "rig resume 20261121-093012-sweep-a1b" in shown
    for piece in ("moving to alpha 90, beta 10 deg", "2/4", "2.50000 V", "scatter 100.000 mV", "28.3 C", "left"):
        assert piece in shown


MOUNTED = Confirm("mounting", "Is it mounted?")


def test_a_person_is_asked_unless_the_file_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Console(file=io.StringIO(), force_terminal=True, width=90)
    monkeypatch.setattr("builtins.input", lambda *prompt: "no")
    with Guide("sweep", {"known": "from the file"}, screen) as guide:
        assert guide.ask(Confirm("known", "Is it known?"), "yes") == "from the file"
        assert guide.ask(MOUNTED, "yes") == "no"


def test_a_person_is_asked_until_the_answer_makes_sense(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Console(file=io.StringIO(), force_terminal=True, width=200)
    said = iter(["much", "90", "0,2"])
    monkeypatch.setattr("builtins.input", lambda *prompt: next(said))
    with Guide("sweep", {}, screen) as guide:
        assert guide.ask(Number("level-x", "What does it show?", unit="deg", low=-45, high=45), None) == "0.2"
    assert "it takes a number from -45 to 45 deg" in screen.file.getvalue()  # type: ignore[attr-defined]


def test_who_is_not_at_a_terminal_is_not_asked() -> None:
    with watching("sweep", unattended=False, answers=None) as watch:
        assert isinstance(watch, Quiet)
        assert watch.ask(MOUNTED, "yes") == "yes"
        with pytest.raises(
            NoAnswer, match=r'to answer "Is it mounted\?"; put `mounting: ...` \(yes or no\) into a file'
        ):
            watch.ask(MOUNTED, None)


def test_times_and_sizes_read_well() -> None:
    assert [duration(s) for s in (5, 750, 3750.4)] == ["0:05", "12:30", "1:02:30"]
    assert [size(n) for n in (512, 3_400_000)] == ["0.5 kB", "3.4 MB"]


def test_columns_stand_under_each_other() -> None:
    assert columns(("run", "poses"), [("a", 518), ("long", 2)]) == "run   poses\na     518\nlong  2"
