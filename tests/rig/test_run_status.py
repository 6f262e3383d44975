"""The status file of a run: while its process works, after its end, and after a kill; how many are kept."""

from __future__ import annotations

import os
import re
from dataclasses import replace

import pytest

from procedures.catalogue import find
from procedures.settings import parse
from rig.bench import read_bench
from rig.bench.file import DEMO, HAND
from rig.cli.terminal.watch import Quiet
from rig.errors import InstrumentFailed, RigError, Stopped
from rig.files import home
from rig.lease import lease
from rig.record import Record
from rig.runs.background import control
from rig.runs.background import status as status_file
from rig.runs.background.process import Attendant
from rig.runs.background.status import KEPT_ESTIMATES, Order, Status, file, folder, keys, lock, read, remove_old_files
from rig.runs.runner import Outcome, start
from rig.web.pages.run_live import progress_words, stop_words
from tests.rig.rigging import POSES, SMALL

KEY = "20261121-093012"


def test_a_process_that_was_killed_has_ended() -> None:
    status = Status(KEY, 4711, "sweep", "a bench", phase="running", values=[], moving=[])
    file(KEY, "json").parent.mkdir(parents=True)
    status.write()
    with lease(home(), lock(KEY), "a test"):
        assert read(KEY) == status
    found = read(KEY)
    assert found is not None
    assert (found.phase, found.state) == ("ended", "stopped")
    file(KEY, "log").write_text("Traceback ...\nMemoryError\n")
    assert "MemoryError" in (read(KEY) or status).error


def test_only_the_last_status_files_are_kept() -> None:
    file(KEY, "json").parent.mkdir(parents=True)
    for number in range(25):
        Status(f"{KEY}-{number:02}", 4711, "sweep", "a bench", phase="ended").write()
    remove_old_files()
    assert [key[-2:] for key in keys()] == [f"{number:02}" for number in range(25 - KEPT_ESTIMATES, 25)]


def test_the_status_of_a_run_in_progress_is_not_removed() -> None:
    folder().mkdir(parents=True)
    for number in range(25):
        Status(f"{KEY}-{number:02}", 4711, "sweep", "a bench", phase="running").write()
    with lease(home(), lock(f"{KEY}-03"), "a test"):
        remove_old_files()
        assert keys()[0] == f"{KEY}-03"
        status = control.latest()  # the one that is under way, though others are newer
        assert status is not None
        assert (status.key, status.phase) == (f"{KEY}-03", "running")


def test_a_process_that_ended_before_its_run_began_has_no_run_to_resume() -> None:
    file(KEY, "json").parent.mkdir(parents=True)
    Status(KEY, os.getpid(), "sweep", "a bench").write()
    alive = read(KEY)
    assert alive is not None
    assert alive.phase == "starting"
    Status(KEY, 2**22 + 1, "sweep", "a bench").write()  # no process has this number
    ended = read(KEY)
    assert ended is not None
    assert ended.error.endswith("it was stopped before the run began")
    assert stop_words(ended) == "Stopped before the run began."
    assert stop_words(replace(ended, error="its process ended: a fault")) == ""


def test_a_process_stopped_by_a_full_disk_has_this_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    folder().mkdir(parents=True)
    Status(KEY, 0, "sweep", "the rig", "running", run="a run").write()
    ended = read(KEY)
    monkeypatch.setattr(status_file, "free_bytes", lambda _: 0)
    full = read(KEY)
    assert ended is not None
    assert full is not None
    assert (ended.state, full.state) == ("stopped", "stopped")
    assert "it was killed" in ended.error
    assert "the disk is full; free some space" in full.error


def test_the_order_to_resume_has_the_bench_of_its_run() -> None:
    bench = read_bench(DEMO).model_dump(mode="json")
    with Record() as record:
        run = record.begin("sweep", {}, bench=bench, identities={}, configuration="", source="a test", constants={})
    assert Order(KEY, "sweep", resume=run).bench().name == read_bench(DEMO).name


def test_the_last_status_counts_the_poses_of_the_record() -> None:
    """A signal can end the run after a pose is stored and before it is counted."""
    folder().mkdir(parents=True)
    writer = status_file.StatusWriter(KEY, "sweep", read_bench(None))
    with Record() as record:
        name = record.begin("sweep", {}, bench={}, identities={}, configuration="", source="a test", constants={})
        writer.begun(name)
        writer.expect(10, 7)
        writer.ended(replace(record.run(name), rows=8, state="stopped"), "stopped")
    last = read(KEY)
    assert last is not None
    assert (last.phase, last.done, last.state, last.error) == ("ended", 8, "stopped", "stopped")
    assert progress_words(last) == "8 of 10 poses"


def test_a_run_that_reaches_its_target_early_is_complete() -> None:
    folder().mkdir(parents=True)
    writer = status_file.StatusWriter(KEY, "hand-turns", read_bench(HAND))
    with Record() as record:
        name = record.begin(
            "hand-turns",
            {},
            bench={"name": "a bench"},
            identities={},
            configuration="",
            source="a test",
            constants={},
            kind="turns",
        )
        writer.begun(name)
        writer.expect(79, 23)
        writer.ended(replace(record.run(name), rows=23, state="complete"), "")
    last = read(KEY)
    assert last is not None
    assert (last.done, last.total) == (23, 23)
    assert progress_words(last) == "23 turns and rests"


@pytest.mark.parametrize(
    ("error", "retried", "said"),
    [
        (InstrumentFailed("beta is away"), False, "beta is away"),
        (InstrumentFailed("beta is away"), True, "continuing failed at TIME UTC: beta is away"),
        (Stopped("stopped by a person"), False, ""),
    ],
)
def test_a_click_on_continue_that_fails_changes_what_the_page_says(
    monkeypatch: pytest.MonkeyPatch, error: RigError, retried: bool, said: str
) -> None:
    folder().mkdir(parents=True)
    monkeypatch.setattr(Attendant, "_answer", lambda *_: "end")
    with Record() as record:
        name = record.begin("sweep", {}, bench={}, identities={}, configuration="", source="a test", constants={})
        outcome = Outcome(record.run(name), error, retried=retried)
    Attendant(Order(KEY, "sweep"), read_bench(None)).interrupted(outcome)
    with lease(home(), lock(KEY), "a test"):
        status = read(KEY)
    assert status is not None
    assert re.sub(r"\d\d:\d\d:\d\d", "TIME", status.error) == said


def test_the_status_of_a_killed_process_is_that_of_its_record() -> None:
    """A process can be killed after a pose is stored and before it is published."""
    folder().mkdir(parents=True)
    bench, sweep = read_bench(None), find("sweep")
    with Record() as record:
        whole = start(record, bench, sweep, parse(sweep, SMALL), Quiet({})).run.run
        part = record.begin("sweep", {}, bench={}, identities={}, configuration="", source="a test", constants={})
        for number, kept in zip(range(3), record.kept(whole), strict=False):
            record.keep(part, number, kept, None)
    for run, done in ((part, 2), (whole, POSES - 1)):
        Status(f"{KEY}-{run}", 4711, "sweep", bench.name, "running", run, done=done, total=POSES).write()
    stopped, complete = read(f"{KEY}-{part}"), read(f"{KEY}-{whole}")
    assert stopped is not None
    assert complete is not None
    assert (stopped.phase, stopped.state, stopped.done) == ("ended", "stopped", 3)
    assert "it was killed" in stopped.error
    assert (complete.phase, complete.state, complete.done, complete.error) == ("ended", "complete", POSES, "")
    assert (complete.total, complete.extent, stopped.extent) == (POSES, f"{POSES} poses", "")
    assert read(f"{KEY}-{part}") == stopped
