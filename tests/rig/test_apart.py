"""A run in a process of its own: it tells how it stands, and is paused, answered and ended by who did not start it."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from procedures.catalogue import find
from procedures.errors import SettingError
from procedures.settings import parse
from rig.bench import read_bench
from rig.cli.terminal.watch import Quiet
from rig.errors import Busy, RigError
from rig.files import home
from rig.instruments.instruments import connect_all
from rig.lease import lease
from rig.record import KeptPose, Record
from rig.record.history import history
from rig.runs.background import control, process
from rig.runs.background import status as status_file
from rig.runs.background.control import PublishingObserver
from rig.runs.background.status import (
    OpenQuestion,
    Order,
    Seat,
    Status,
    file,
    folder,
    keys,
    lock,
    mark_stop,
)
from rig.runs.runner import Outcome, start
from tests.rig.rigging import POSES, SMALL

POLL_S = 0.002
PATIENCE_S = 60.0
KEY = "20261121-093012"


@pytest.fixture(autouse=True)
def every_event(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every event of a simulated run is published, so that a test can act between two poses."""
    monkeypatch.setattr(status_file, "EVERY_S", 0.0)


def carried_out(procedure: str, settings: dict[str, str], steer: Callable[[], None], attended: bool = False) -> Status:
    """The order, carried out in this very process while `steer` has a thread of its own; how it stands at the end."""
    order = Order(KEY, procedure, settings, attended=attended)
    file(KEY, "log").parent.mkdir(parents=True)
    os.mkfifo(file(KEY, "answers"))
    faults: list[Exception] = []
    ended = threading.Event()

    def act() -> None:
        try:
            steer()
        except Exception as fault:
            faults.append(fault)
            if not ended.is_set():
                os.kill(os.getpid(), signal.SIGTERM)  # else the run would wait for ever

    person = threading.Thread(target=act)
    person.start()
    process.main(order.text())
    ended.set()
    person.join()
    assert faults == []
    status = control.latest()
    assert status is not None
    return status


def when(phase: str, also: Callable[[Status], bool] = lambda _: True) -> Status:
    """The status, as soon as it is at `phase`."""
    never = threading.Event()
    for _ in range(round(PATIENCE_S / POLL_S)):
        status = control.latest()
        if status is not None and status.phase == phase and also(status):
            return status
        never.wait(POLL_S)
    raise AssertionError(f"never {phase}: {status}")


def test_a_run_publishes_its_progress_and_its_end() -> None:
    seen: list[Status] = []
    status = carried_out("sweep", SMALL, lambda: seen.append(when("running", lambda s: s.done > 2)))
    assert (status.phase, status.state, status.done, status.total, status.error) == ("ended", "complete", 20, POSES, "")
    assert seen[0].bench == "simulated rig"
    assert {value["name"] for value in seen[0].values} >= {"temperature", "vx", "vy"}
    assert seen[0].attitude["alpha_deg"] == 90
    with Record() as record:
        assert record.run(status.run).state == "complete"


def test_a_run_is_paused_continued_and_stopped() -> None:
    def person() -> None:
        control.pause(when("running"))
        paused = when("paused")
        assert paused.error == ""
        control.answer(paused, "resume")
        control.stop(when("running"))

    status = carried_out("soak", {"duration_s": "43200"}, person)
    assert (status.phase, status.state) == ("ended", "stopped")
    assert status.error == f"stopped on a page of the workbench; `rig resume {status.run}` continues the run"
    with Record() as record:
        turns = [(event.what, event.text.partition(";")[0]) for event in history(record, status.run)]
    assert turns[0] == ("begun", "soak at pose 0, on a page of the workbench")
    assert ("stopped", "on a page of the workbench") in turns


def test_a_second_pause_changes_nothing() -> None:
    def person() -> None:
        control.pause(when("running"))
        control.pause(when("paused"))
        control.answer(when("paused"), "resume")
        control.stop(when("running"))

    status = carried_out("soak", {"duration_s": "43200"}, person)
    assert "stopped on a page of the workbench" in status.error


def test_several_requests_for_a_pause_are_one_pause() -> None:
    def person() -> None:
        done = 0
        for _ in range(2):
            when("running", lambda status, done=done: status.done > done)  # it measures again
            for _ in range(200):  # from the stop of the stages to the question, and while it is open
                os.kill(os.getpid(), signal.SIGINT)
                threading.Event().wait(POLL_S)
            paused = when("paused")
            done = paused.done
            control.answer(paused, "resume")
        control.stop(when("running", lambda status: status.done > done))

    assert carried_out("soak", {"duration_s": "43200"}, person).error.startswith("stopped on a page of the workbench")


def test_a_request_for_a_pause_while_the_run_reconnects_pauses_it(monkeypatch: pytest.MonkeyPatch) -> None:
    connections: list[int] = []

    def interrupted(*arguments: Any) -> Any:
        connections.append(1)
        if len(connections) == 2:
            signal.raise_signal(signal.SIGINT)
        return connect_all(*arguments)

    monkeypatch.setattr("rig.runs.runner.connect_all", interrupted)

    def person() -> None:
        control.pause(when("running"))
        control.answer(when("paused"), "resume")
        control.answer(when("paused", lambda _: len(connections) == 2), "end")

    assert carried_out("soak", {"duration_s": "43200"}, person).state == "stopped"
    assert len(connections) == 2


def test_a_paused_run_is_stopped() -> None:
    def person() -> None:
        control.pause(when("running"))
        control.stop(when("paused"))

    assert carried_out("soak", {"duration_s": "43200"}, person).state == "stopped"


def test_a_question_is_repeated_until_its_answer_is_valid() -> None:
    refused: list[str] = []

    def person() -> None:
        asking = when("asking")
        assert asking.asked is not None
        assert asking.asked.choices == ["yes", "no"]
        assert asking.asked.attitude is not None
        control.answer(asking, "perhaps")
        again = when("asking", lambda s: bool(s.asked and s.asked.refused))
        assert again.asked is not None
        refused.extend([again.asked.refused, again.asked.typed])
        control.answer(again, "yes")

    status = carried_out("sweep", SMALL, person, attended=True)
    assert status.state == "complete"
    assert refused == ["'perhaps' is not a valid answer; answer with yes or no", "perhaps"]


def test_an_impossible_run_has_its_error_in_the_status() -> None:
    with pytest.raises(SettingError):
        carried_out("sweep", {"step_deg": "ten"}, lambda: None)
    status = control.latest()
    assert status is not None
    assert (status.phase, status.state) == ("ended", "failed")
    assert "give a number" in status.error


class Onlooker(Quiet):
    """Nobody in a terminal; at each pose it looks at what other processes see."""

    def __init__(self, stop_at: int = 10**6) -> None:
        super().__init__({})
        self.seen: list[Status | None] = []
        self.stop_at = stop_at

    def kept(self, kept: KeptPose) -> None:
        super().kept(kept)
        self.seen.append(control.latest())
        if len(self.seen) == self.stop_at and (status := self.seen[-1]):
            control.stop(status)


def in_a_terminal(onlooker: Onlooker, seat: Seat) -> Outcome:
    """A small sweep as `rig run` does it."""
    bench, sweep = read_bench(), find("sweep")
    with Record() as record, PublishingObserver(onlooker, "sweep", bench, seat) as watch:
        return start(record, bench, sweep, parse(sweep, SMALL), watch)


def test_a_run_in_a_terminal_publishes_its_status() -> None:
    onlooker = Onlooker()
    run = in_a_terminal(onlooker, "nobody").run.run
    last = onlooker.seen[-1]
    assert last is not None
    assert (last.run, last.phase, last.done, last.total, last.seat) == (run, "running", POSES - 1, POSES, "nobody")
    assert {value["name"] for value in last.values} >= {"temperature", "vx", "vy"}
    ended = control.latest()
    assert ended is not None
    assert (ended.phase, ended.state, ended.error) == ("ended", "complete", "")
    with pytest.raises(RigError, match="so it cannot pause"):
        control.pause(last)


def test_events_of_a_fast_simulated_run_share_a_write_of_the_status(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(status_file, "EVERY_S", 3600.0)
    onlooker = Onlooker()
    in_a_terminal(onlooker, "nobody")
    assert {status.done for status in onlooker.seen if status} == {0}
    ended = control.latest()
    assert ended is not None
    assert (ended.phase, ended.state, ended.done) == ("ended", "complete", POSES)
    assert {value["name"] for value in ended.values} >= {"temperature", "vx", "vy"}


def test_a_run_of_a_terminal_is_stopped_from_elsewhere() -> None:
    assert in_a_terminal(Onlooker(stop_at=3), "nobody").run.state == "stopped"
    ended = control.latest()
    assert ended is not None
    assert (ended.phase, ended.state) == ("ended", "stopped")
    assert "stopped on a page of the workbench" in ended.error
    assert not file(ended.key, "stop").exists()


def test_a_signal_of_another_program_is_not_taken_for_a_stop_on_a_page() -> None:
    """Not even after the mark of a pause that the run did not hear."""

    def person() -> None:
        running = when("running")
        mark_stop(running.key, "SIGINT")
        os.kill(running.pid, signal.SIGTERM)

    status = carried_out("soak", {"duration_s": "43200"}, person)
    assert status.error == f"stopped by another program; `rig resume {status.run}` continues the run"
    assert not file(status.key, "stop").exists()


def test_a_mark_that_cannot_be_written_does_not_prevent_a_stop_on_a_page() -> None:
    def person() -> None:
        running = when("running")
        file(running.key, "stop").mkdir()
        control.stop(running)

    assert carried_out("soak", {"duration_s": "43200"}, person).state == "stopped"


def test_a_question_of_a_terminal_is_answered_in_the_terminal() -> None:
    asked = OpenQuestion("mounting", "Is it mounted?", "yes or no")
    status = Status(KEY, 4711, "sweep", "a bench", phase="asking", asked=asked, seat="terminal")
    with pytest.raises(RigError, match="answer there"):
        control.answer(status, "yes")


def test_a_run_continues_without_a_folder_for_its_status() -> None:
    home().mkdir(parents=True, exist_ok=True)
    folder().write_text("a file is in the way")
    assert in_a_terminal(Onlooker(), "nobody").run.state == "complete"


def test_an_answer_without_a_question_is_refused() -> None:
    assert (control.latest(), keys()) == (None, [])
    status = Status(KEY, 4711, "sweep", "a bench")
    status_of_one_who_asked = replace(status, asked=OpenQuestion("mounting", "Is it mounted?", "yes or no"))
    with pytest.raises(RigError, match="the run has no question"):
        control.answer(status, "yes")
    file(KEY, "answers").parent.mkdir(parents=True)
    os.mkfifo(file(KEY, "answers"))
    with pytest.raises(RigError, match="does not wait for an answer"):
        control.answer(status_of_one_who_asked, "yes")


def test_a_second_start_is_refused_while_a_run_is_in_progress() -> None:
    file(KEY, "json").parent.mkdir(parents=True)
    Status("20261121-093012-000000-ab12", 4711, "sweep", "a bench", phase="running").write()
    with (
        lease(home(), lock("20261121-093012-000000-ab12"), "a test"),
        pytest.raises(Busy, match="sweep is in progress since"),
    ):
        control.begin("sweep", SMALL, None, attended=False)


def test_a_process_that_fails_at_its_start_does_not_block_the_next_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "program"
    program.write_text(f"#!/bin/sh\ncat {folder()}/*.answers\necho out of memory >&2\nexit 1\n")
    program.chmod(0o700)
    monkeypatch.setattr(sys, "executable", str(program))
    first = control.begin("sweep", SMALL, None, attended=False)
    assert when("starting").key == first
    file(first, "answers").open("w").close()  # now the process goes on, and fails
    assert when("ended").error.endswith("out of memory")
    program.write_text("#!/bin/sh\n")
    second = control.begin("sweep", SMALL, None, attended=False)
    assert when("ended").key == second


def test_the_first_of_two_simultaneous_answers_counts() -> None:
    file(KEY, "answers").parent.mkdir(parents=True)
    os.mkfifo(file(KEY, "answers"))
    with process._pipe(KEY) as receive, file(KEY, "answers").open("w") as answers:
        answers.write('{"name": "mounting", "text": "yes"}{"name": "mounting", "text": "no"}')
        answers.flush()
        assert receive() == {"name": "mounting", "text": "yes"}
        answers.write("nonsense")
        answers.flush()
        assert receive() == {}
