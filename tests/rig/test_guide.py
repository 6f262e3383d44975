"""The guided terminal: what a person sees before and during a run, and is asked."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console, RenderableType

from calibrations.text import columns, duration, size
from drivers.recorder import Samples
from procedures.catalogue import find
from procedures.errors import Declined, NoAnswer
from procedures.questions import Choice, Confirm, Mounting, Number
from procedures.session import Limits, Pose, Reading
from rig.bench import Bench, read_bench
from rig.cli.terminal.guide import Guide
from rig.cli.terminal.screen import WIDTH, gauge, screen, screen_before_run
from rig.cli.terminal.watch import watching
from rig.drawings import Attitude, page
from rig.errors import Stopped
from rig.files import free_bytes
from rig.planning.plan import Plan, plan
from rig.planning.preparation import checks, mounting
from rig.record import KeptPose, Record
from rig.runs.estimates import nearness
from rig.runs.observer import Progress, RunView
from rig.runs.runner import Outcome
from rig.web.pages.run_begin import before_resume, before_start, plan_facts
from tests.rig.rigging import POSES, small_sweep

TODAY = date(2026, 11, 21)
SWEEP = find("sweep")


def kept(number: int, noise: float = 0.1, path: str = "") -> KeptPose:
    block = Samples(np.array([[2.5 - noise, 2.5], [2.5 + noise, 2.5]]), ("vx", "vy"), 1000.0, 0.0)
    return KeptPose(Pose(90, 10.0 * number, 1, path), block, 3600.0, 28.3)


def shown(renderable: RenderableType) -> str:
    """As a terminal of 120 columns shows it, without colour."""
    console = Console(file=io.StringIO(), width=120)
    console.print(renderable)
    return console.file.getvalue()  # type: ignore[attr-defined]


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """What the person types, in order; then the terminal is closed."""

    def say(*words: str) -> None:
        typed = iter(words)

        def answer(*prompt: object) -> str:
            try:
                return next(typed)
            except StopIteration:
                raise EOFError from None

        monkeypatch.setattr("builtins.input", answer)

    return say


@pytest.fixture
def run() -> str:
    """A run that has begun, as the record has it."""
    with Record() as record:
        made = {"bench": {}, "configuration": "", "constants": {}, "source": "test", "identities": {}}
        return record.begin("sweep", {}, kind="poses", **made)


def guide(**answers: str) -> tuple[Guide, io.StringIO]:
    told = io.StringIO()
    return Guide(SWEEP, read_bench(), answers, Console(file=told, force_terminal=True, width=120)), told


# before


def planned(name: str = "sweep", bench: Bench | None = None) -> Plan:
    procedure = find(name)
    return plan(bench or read_bench(), procedure, procedure.defaults)


def test_one_screen_shows_the_whole_plan_before_a_run() -> None:
    text = shown(screen_before_run(planned(), SWEEP, read_bench(), 2_000_000_000, TODAY))
    for piece in (
        "Hold the sensor at a grid of stage angles, in both directions of beta.",
        "scale factor, bias, cross-axis effects, misalignment, hysteresis, stage errors.",
        "518 poses",
        "56:",
        "alpha 90, beta 0 to 360 deg: 37 poses",
        "from -5 to 365 deg; the limits are -400 to 400 deg",
        "not at -20 to 85 C; if the tilt of the table exceeds 0.3 deg",
        "MB on the disk; 2.0 GB are free",
        "[ ] the cables are long enough",
        "[ ] the level lies on the table",
        "of simulated time",
    ):
        assert piece in text
    assert len(text.splitlines()) < 35


def test_the_plan_names_a_disk_that_is_too_small() -> None:
    assert "not enough space" in shown(screen_before_run(planned(), SWEEP, read_bench(), 1000, TODAY))


def test_the_page_shows_the_same_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.web.pages.run_begin.free_bytes", lambda _: 1000)
    assert plan_facts(planned(), read_bench())["Stores"].endswith("on the disk; 1.0 kB are free: not enough space")


def test_a_plan_without_poses_and_turns_promises_none() -> None:
    facts = plan_facts(planned("level-check"), read_bench())
    assert facts["Stores"] == "its readings, and no poses"
    assert facts["Turns alpha"].startswith("to 0 deg; the limits are ")
    assert facts["Turns beta"].startswith("from 0 to 180 deg; ")
    whole = planned()
    assert plan_facts(replace(whole, held=whole.held[:1]), read_bench())["Stores"].startswith("1 pose, ")


def test_the_page_shows_before_a_resume_what_remains_with_the_same_limits() -> None:
    bench, whole = read_bench(), planned()
    with Record() as record:
        name = record.begin("sweep", {}, bench={}, identities={}, configuration="", source="a test", constants={})
        run = replace(record.run(name), rows=whole.poses // 2)
    begin, resumed = before_start(whole, bench), before_resume(run, whole, bench, Attitude(flip=1))
    assert resumed.facts["Recorded"] == f"{run.rows} of {whole.poses} poses"
    assert resumed.facts["Stores"].startswith(f"{whole.poses - run.rows} poses, ")
    assert resumed.facts["Takes"] != begin.facts["Takes"]
    assert resumed.facts["Takes"].endswith(f"the whole run {begin.facts['Takes'].partition(',')[0]}")
    assert {name: resumed.facts[name] for name in ("Turns alpha", "Turns beta", "Stops")} == {
        name: begin.facts[name] for name in ("Turns alpha", "Turns beta", "Stops")
    }
    assert resumed.facts["Sensor"] == "ADXL203 simulated"
    assert set(resumed.checks) <= set(begin.checks)
    assert resumed.attitude == Attitude(flip=1)
    assert whole.after(run.rows).duration_s + whole.held[run.rows].start_s == whole.duration_s


def test_the_plan_names_an_expired_certificate() -> None:
    document = read_bench().document()
    document["certificates"] = {"hand level": {"number": "L-7", "due": "2026-11-20"}}
    text = shown(screen_before_run(planned(), SWEEP, Bench.model_validate(document), 10**9, TODAY))
    assert "hand level's certificate L-7 expired on 2026-11-20" in text


def test_the_checks_before_a_run_follow_from_the_plan() -> None:
    document = read_bench().document()
    del document["instruments"]["level"]
    assert any("you will read it" in line for line in checks(planned("sweep", Bench.model_validate(document))))
    assert any("the oven is closed" in line for line in checks(planned("temperature-cycle")))
    assert not any("oven" in line for line in checks(planned()))


def test_the_drawing_before_a_run_is_that_of_its_first_mounting() -> None:
    assert mounting(planned("noise-floor")) == Attitude()
    asked = replace(planned(), asked=(Confirm("a", "b"), Mounting.of(90.0, 1)))
    assert mounting(asked) == Attitude(mount_deg=90.0, flip=1)


def test_room_is_measured_where_the_folder_will_be(tmp_path: Path) -> None:
    assert free_bytes(tmp_path / "not" / "yet") > 0


def test_a_run_begins_or_is_cancelled(said: Callable[..., None], rig_home: Path) -> None:
    said("perhaps", "cancel")
    with guide()[0] as shown_to, pytest.raises(Declined, match="cancelled before the start"):
        shown_to.planned(planned())
    said("go")
    with guide()[0] as shown_to:
        shown_to.planned(planned())
    assert (rig_home / "drawings" / "mounting.svg").read_text() == page(Attitude())


def test_a_file_of_answers_begins_it_too(said: Callable[..., None]) -> None:
    said()
    with guide(begin="go")[0] as shown_to:
        shown_to.planned(planned())


# during


def test_it_shows_what_happens_progress_readings_and_time(run: str) -> None:
    shown_to, told = guide()
    with shown_to:
        shown_to.begun(run)
        shown_to.expect(4, 1)
        shown_to.read(Reading("level-front-x", 0.25, "deg"))
        shown_to.doing("moving to alpha 90, beta 10 deg")
        shown_to.kept(kept(1))
    text = told.getvalue()
    for piece in (run, "moving to alpha 90, beta 10 deg", "2/4 poses", "2.50000 V", "rms 141", "28.3 C", "left"):
        assert piece in text
    assert "level-front-x = 0.25 deg" in text
    assert "Ctrl-C stops the stages" in text


def seen(**changes: Any) -> RunView:
    return replace(RunView("sweep", Limits(level_deg=0.3), 10.0, False, lambda _: "V"), **changes)


def test_values_are_shown_between_their_limits_and_marked_near_them() -> None:
    text = shown(screen(seen(kept=kept(1)), 0.0))
    assert "near" not in text
    assert "28.3 C     -20 ├" in text
    hot = replace(kept(1), temperature_c=84.0)
    assert "near its limit" in shown(screen(seen(kept=hot), 0.0))
    assert "beyond its limit" in shown(screen(seen(kept=replace(hot, temperature_c=86.0)), 0.0))
    assert "near its limit" in shown(screen(seen(kept=kept(1, noise=7.0)), 0.0))  # a sample at 9.5 of 10 V


def test_it_fits_a_terminal_of_80_columns() -> None:
    console = Console(file=io.StringIO(), width=80)
    console.print(screen(seen(kept=kept(1), usual={"vx": 0.14, "vy": 0.1}), 0.0))
    (line,) = [line for line in console.file.getvalue().splitlines() if "vx" in line]  # type: ignore[attr-defined]
    assert line.rstrip(" │").endswith("rms 141.421 mV, as usual")


def test_the_level_is_shown_when_it_was_read_both_ways_round() -> None:
    one = {"level-front-x": 0.4, "level-front-y": 0.0}
    assert "level x" not in shown(screen(seen(tilt=one), 0.0))
    both = {**one, "level-back-x": -0.18, "level-back-y": 0.0}
    text = shown(screen(seen(tilt=both), 0.0))
    assert "0.290 deg" in text
    assert "near its limit" in text


def test_scatter_is_compared_with_what_is_usual_for_such_poses(run: str) -> None:
    shown_to, _ = guide()
    with shown_to:
        shown_to.begun(run)
        for number in range(3):
            shown_to.kept(kept(number, 0.001, "still 1"))
        assert "as usual" in shown(shown_to._render())
        shown_to.kept(kept(4, 0.005, "still 2"))
        assert "5 times the usual value" in shown(shown_to._render())
        shown_to.kept(kept(5, 0.5, "motion 1"))
        assert "usual" not in shown(shown_to._render())


@pytest.mark.parametrize(
    ("value", "near", "place"),
    [(0.0, "", 7), (-1.0, "near its limit", 1), (0.85, "near its limit", 12), (3.0, "beyond its limit", 13)],
)
def test_a_gauge_has_its_mark_where_the_value_is(value: float, near: str, place: int) -> None:
    bar = gauge(value, -1.0, 1.0).plain
    assert (len(bar), bar.index("●")) == (WIDTH, place)
    assert nearness(value, -1.0, 1.0) == near


def test_nan_is_beyond_its_limit() -> None:
    assert nearness(float("nan"), -1.0, 1.0) == "beyond its limit"
    assert gauge(float("nan"), -1.0, 1.0).plain.index("●") == WIDTH - 2


# time left


def test_the_remaining_time_is_that_of_the_plan_before_the_first_pose() -> None:
    way = Progress(at_s=(10.0, 20.0, 90.0), end_s=100.0).begin(0.0).expect(3, 0)
    assert (way.planned_left_s(), way.left_s(5.0)) == (90.0, None)
    one = way.step(2.0)  # ten planned seconds took two
    assert one.left_s(2.0) == pytest.approx(16.0)
    assert one.left_s(5.0) == pytest.approx(13.0)  # it counts down while nothing is kept
    assert one.left_s(100.0) == 0.0
    assert one.step(16.0).left_s(16.0) == pytest.approx(2.0)  # the long way before the last is known


def test_without_a_plan_poses_are_all_alike() -> None:
    way = Progress().begin(1000.0).expect(8, 4)  # the wall clock does not begin at 0
    assert way.planned_left_s() is None
    assert way.step(1003.0).left_s(1003.0) == pytest.approx(9.0)


def test_a_procedure_that_expects_part_by_part_has_the_plans_total() -> None:
    way = Progress(at_s=(0.0,) * 10, end_s=1.0).begin(0.0).expect(4, 0)
    assert way.total == 10
    assert Progress().begin(0.0).expect(4, 0).step(1.0).expect(10, 4).first == 0


def test_simulated_time_is_called_simulated() -> None:
    way = Progress(at_s=(10.0,), end_s=60.0).expect(1, 0)
    assert "0:50 left, as planned" in shown(screen(seen(progress=way), 0.0))
    assert "0:50 of simulated time left, as planned" in shown(screen(seen(progress=way, simulated=True), 0.0))


# questions

MOUNTED = Confirm("mounting", "Is it mounted?", "face-up")


def test_a_person_is_asked_unless_the_file_answers(said: Callable[..., None]) -> None:
    said("no")
    with guide(known="from the file")[0] as shown_to:
        assert shown_to.ask(Confirm("known", "Is it known?"), "yes") == "from the file"
        assert shown_to.ask(MOUNTED, "yes") == "no"


def test_a_question_is_repeated_until_the_answer_is_valid(said: Callable[..., None]) -> None:
    said("much", "90", "0,2")
    shown_to, told = guide()
    with shown_to:
        assert shown_to.ask(Number("level-x", "What does it show?", unit="deg", low=-45, high=45), None) == "0.2"
    assert "answer with a number from -45 to 45 deg" in told.getvalue()


def test_a_question_has_its_drawing_once(said: Callable[..., None], rig_home: Path) -> None:
    said("yes", "yes", "yes")
    shown_to, told = guide()
    with shown_to:
        for question in (MOUNTED, MOUNTED, Mounting.of(90.0, 1)):
            shown_to.ask(question, "yes")
    assert told.getvalue().count("pin 1") == 2
    assert (rig_home / "drawings" / "mount-90-down.svg").read_text() == page(Attitude(0, 0, 90, 1))


def test_a_closed_terminal_gives_no_answer(golden, said: Callable[..., None]) -> None:
    said()
    with guide()[0] as shown_to, golden.refused(NoAnswer):
        shown_to.ask(MOUNTED, "yes")


@pytest.fixture
def outcome() -> Iterator[Outcome]:
    """A run that was stopped; alpha did not obey."""

    with Record() as record:
        run = record.begin("sweep", {}, bench={}, identities={}, configuration="", constants={}, source="")
        yield Outcome(record.run(run), Stopped("stopped by a person"), ("alpha may still move: silence",))


def test_the_menu_explains_each_answer(said: Callable[..., None], outcome: Outcome, run: str) -> None:
    said("go", "repeat")
    shown_to, told = guide()
    with shown_to:
        shown_to.begun(run)
        shown_to.kept(kept(1))
        assert shown_to.interrupted(outcome) == "repeat"
        assert shown_to.interrupted(outcome) == "end"  # the terminal is closed
    text = told.getvalue()
    for piece in (
        "stopped by a person",
        "alpha may still move: silence",
        "alpha 90, beta 10 deg",
        "answer with one of resume",
    ):
        assert piece in text


# nobody


def test_no_question_is_asked_without_a_terminal(outcome: Outcome) -> None:
    with watching(SWEEP, read_bench(), unattended=False, answers=None) as watch:
        watch.planned(planned())
        assert watch.interrupted(outcome) == "end"
        assert watch.ask(MOUNTED, "yes") == "yes"
        with pytest.raises(
            NoAnswer,
            match=r'the question "Is it mounted\?" has no answer; write `mounting: ...` \(yes or no\) into a file',
        ):
            watch.ask(MOUNTED, None)


# words


def test_times_and_sizes_read_well() -> None:
    assert [duration(s) for s in (5, 750, 3750.4)] == ["0:05", "12:30", "1:02:30"]
    assert [size(n) for n in (512, 3_400_000, 80_700_000_000)] == ["0.5 kB", "3.4 MB", "80.7 GB"]


def test_columns_of_a_table_are_aligned() -> None:
    assert columns(("run", "poses"), [("a", 518), ("long", 2)]) == "run   poses\na     518\nlong  2"


def test_the_small_sweep_has_the_poses_that_other_tests_assume() -> None:
    assert plan(read_bench(), *small_sweep()).poses == POSES
    assert Choice("begin", "Begin?", choices=("go", "cancel")).checked("go") == "go"
