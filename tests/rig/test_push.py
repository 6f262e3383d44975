"""Pushing into a real server: each run arrives whole, once, however often the wire is cut or whoever pushes beside."""

from __future__ import annotations

import re
import shutil
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from sqlalchemy import insert

from rig.errors import LabAway, RecordError, UnknownRun
from rig.lab_url import lab_url
from rig.record import Record
from rig.record import lab as laboratory
from rig.record import push as pushing
from rig.record.content import run_row, uid_of
from rig.record.push import PushedRun, push, push_all, unsent, verify
from rig.record.schema import arrivals, runs
from tests.rig.cutting import Enough, Judge, after_bytes, at_random, whole, wire
from tests.rig.postgres import Server
from tests.rig.pushing import POSES, a_run, a_table, held, pushed, until_there

COMMITS = 5  # of a push of one run in small batches


@pytest.fixture
def lab(server: Server, database: str) -> Iterator[Record]:
    with Record(lab_url(server.url(database))) as record:
        yield record


@pytest.fixture
def own(tmp_path: Path) -> Iterator[Record]:
    with Record(tmp_path / "rig") as record:
        yield record


@pytest.fixture
def small_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two poses or so."""
    monkeypatch.setattr(pushing, "MOST_BYTES", 15_000)


def test_a_run_arrives_to_the_last_bit_and_is_not_sent_again(own: Record, lab: Record) -> None:
    runs = [a_run(own), a_table(own)]
    assert unsent(own, lab) == runs
    assert [(each.run, each.name, each.how) for each in pushed(own, lab.where)] == [(r, r, "pushed") for r in runs]
    assert [held(lab, run) for run in runs] == [held(own, run) for run in runs]
    assert [run.run for run in lab.runs()] == runs[::-1]
    assert unsent(own, lab) == []
    assert push(own, lab, runs[0]).how == "there"
    assert verify(lab).sound == tuple(sorted(runs))


def test_only_complete_runs_are_pushed(own: Record, lab: Record) -> None:
    stopped = a_run(own, state="stopped")
    assert unsent(own, lab) == []
    for call in (lambda: push(own, lab, stopped), lambda: unsent(own, lab, [stopped])):
        with pytest.raises(
            RecordError, match=f"{stopped} is stopped, and only complete runs are pushed; `rig resume {stopped}`"
        ):
            call()
    with pytest.raises(UnknownRun):
        unsent(own, lab, ["sweep-1"])
    own.set_state(stopped, "complete")
    assert [each.run for each in pushed(own, lab.where)] == [stopped]


@pytest.mark.slow
@pytest.mark.usefixtures("small_batches")
def test_all_runs_arrive_once_although_the_wire_is_cut_anywhere(
    own: Record, lab: Record, server: Server, database: str
) -> None:
    runs = [a_run(own, seed) for seed in range(3)]
    with wire(server.port, at_random(7, 120_000)) as cut:
        _, cuts = until_there(own, server.url(database, port=cut.port))
    assert cuts > 5
    assert unsent(own, lab) == []
    assert [held(lab, run) for run in runs] == [held(own, run) for run in runs]
    assert verify(lab).sound == tuple(sorted(runs))
    assert len(lab.runs()) == 3


@pytest.mark.usefixtures("small_batches")
def test_a_partly_pushed_run_is_invisible_and_the_next_push_completes_it(
    own: Record, lab: Record, server: Server, database: str
) -> None:
    run = a_run(own)
    with wire(server.port, whole) as uncut:
        pushed(own, server.url(server.new_database("prepared"), port=uncut.port))
        of_all = uncut.bytes
    with wire(server.port, after_bytes(lambda: of_all * 2 / 3)) as cut, pytest.raises(LabAway):
        pushed(own, server.url(database, port=cut.port))
    assert lab.runs() == []
    with pytest.raises(UnknownRun):
        lab.run(run)
    assert verify(lab).on_their_way == (run,)
    with wire(server.port, whole) as uncut:
        pushed(own, server.url(database, port=uncut.port))
        assert uncut.bytes < of_all * 2 / 3
    assert held(lab, run) == held(own, run)


def at_commit(number: int) -> Callable[[], Judge]:
    """The wire is cut as the server confirms the commit of this number, so that nobody hears of it."""
    commits = 0

    def judge(piece: bytes, from_server: bool) -> None:
        nonlocal commits
        commits += from_server and b"COMMIT\0" in piece
        if from_server and commits == number and b"COMMIT\0" in piece:
            raise Enough

    return lambda: judge


@pytest.mark.usefixtures("small_batches")
@pytest.mark.parametrize("number", [1, 3, COMMITS])
def test_a_commit_whose_answer_is_lost_counts_once(
    own: Record, lab: Record, server: Server, database: str, number: int
) -> None:
    run = a_run(own)
    with wire(server.port, at_commit(number)) as cut, pytest.raises(LabAway):
        pushed(own, server.url(database, port=cut.port))
    assert [each.run for each in lab.runs()] == ([run] if number == COMMITS else [])
    assert len(pushed(own, lab.where)) == (number < COMMITS)
    assert held(lab, run) == held(own, run)


def test_a_server_that_ends_the_connection_loses_nothing(
    own: Record, lab: Record, server: Server, database: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = a_run(own)
    seal = pushing._seal
    others = f"SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = '{database}'"  # noqa: S608

    def ended(*arguments: object) -> None:
        monkeypatch.setattr(pushing, "_seal", seal)
        server.sql(others)
        seal(*arguments)

    monkeypatch.setattr(pushing, "_seal", ended)
    with pytest.raises(LabAway, match="terminating connection due to administrator command"):
        push(own, lab, run)
    assert lab.runs() == []
    assert push(own, lab, run).how == "pushed"
    assert held(lab, run) == held(own, run)


@pytest.mark.usefixtures("small_batches")
def test_two_simultaneous_pushes_of_a_run_store_it_once(
    own: Record, server: Server, database: str, lab: Record
) -> None:
    run = a_run(own)
    gate, done = threading.Barrier(2), []

    def carry() -> None:
        with Record(own.folder) as mine, Record(lab_url(server.url(database))) as there:
            gate.wait()
            done.append(push(mine, there, run))

    threads = [threading.Thread(target=carry) for _ in range(2)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert {each.name for each in done} == {run}
    assert [each.how for each in done].count("pushed") == 1
    assert held(lab, run) == held(own, run)
    assert len(lab.lines(run)) == POSES


def test_runs_of_two_rigs_with_one_name_stay_separate(own: Record, lab: Record, tmp_path: Path) -> None:
    run = a_run(own)
    with Record(Path(shutil.copytree(own.folder, tmp_path / "other"))) as other:
        with other.engine.begin() as to:
            to.exec_driver_sql("UPDATE runs SET uid = 'cafe1234cafe1234'")
        other.exclude(run, [1], "of the other rig")
        assert [each.name for each in pushed(own, lab.where)] == [run]
        (theirs,) = pushed(other, lab.where)
        assert theirs.name == f"{run}-cafe1234"
        assert held(lab, run) == held(own, run)
        assert held(lab, theirs.name) == held(other, run)
        assert push(other, lab, run) == PushedRun(run, theirs.name, "there", theirs.digest)


def test_an_excluded_row_of_an_imported_table_is_excluded_by_the_next_push(own: Record, lab: Record) -> None:
    run = a_table(own)
    push(own, lab, run)
    own.exclude(run, [1], "bumped")
    assert unsent(own, lab) == [run]
    push(own, lab, run)
    assert lab.excluded(run) == own.excluded(run) == {1: "bumped"}


def test_a_pose_that_is_excluded_later_is_excluded_by_the_next_push(own: Record, lab: Record) -> None:
    run = a_run(own)
    pushed(own, lab.where)
    own.exclude(run, [3], "a lorry passed")
    own.set_results(run, {"bias-x": {"value": 2.4}})
    assert unsent(own, lab) == [run]
    assert [each.how for each in pushed(own, lab.where)] == ["pushed"]
    own.note(run, "note", "the door was open")
    assert unsent(own, lab) == [run]
    own.exclude(run, [3], None)
    own.exclude(run, [4], "another")
    pushed(own, lab.where)
    assert held(lab, run) == held(own, run)


def test_a_run_that_was_changed_in_the_lab_is_not_overwritten(own: Record, lab: Record) -> None:
    run = a_run(own)
    pushed(own, lab.where)
    lab.exclude(run, [3], "by the lab")
    assert verify(lab).changed == (run,)
    assert unsent(own, lab) == []
    own.exclude(run, [4], "by the rig")
    with pytest.raises(RecordError, match="is different from the run of this rig, so nothing was replaced"):
        push(own, lab, run)
    assert lab.excluded(run) == {3: "by the lab"}


def test_a_byte_that_is_lost_in_the_lab_is_noticed(own: Record, lab: Record, server: Server, database: str) -> None:
    run, other = a_run(own, 1), a_run(own, 2)
    pushed(own, lab.where)
    server.sql(f"DELETE FROM log WHERE line = (SELECT max(line) FROM log WHERE run = '{run}')", database)  # noqa: S608
    spoil = f"UPDATE blocks SET samples = samples || '\\x00' WHERE run = '{other}' AND number = 5"  # noqa: S608
    server.sql(spoil, database)
    assert set(verify(lab).changed) == {run, other}


def test_a_lab_that_stops_answering_counts_as_away(lab: Record, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(laboratory, "SILENCE_S", 0.1)
    said = re.escape("no connection to the lab's record (no answer for 0.1 s)")
    with pytest.raises(LabAway, match=said), lab.engine.connect() as at:
        at.exec_driver_sql("SELECT pg_sleep(20)")
    with lab.engine.connect() as at:
        assert at.exec_driver_sql("SHOW idle_in_transaction_session_timeout").scalar() == "1min"


def test_a_push_reports_a_locked_run_and_does_not_wait(
    own: Record, lab: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(laboratory, "LOCK_S", 0.1)
    run = a_run(own)
    with lab.engine.begin() as stopped:
        with own.engine.connect() as at:  # the transaction of a stopped program stays open
            stopped.execute(insert(runs), {**run_row(at, run)._mapping, "run": run})
            stopped.execute(insert(arrivals), {"uid": uid_of(at, run), "run": run, "at": ""})
        with (
            Record(lab_url(lab.where)) as another,
            pytest.raises(RecordError, match="another push has locked this run"),
        ):
            push(own, another, run)
        stopped.rollback()
    assert push(own, lab, run).how == "pushed"


def test_a_refused_run_does_not_hinder_the_newer_ones(own: Record, lab: Record) -> None:
    run = a_run(own, 1)
    pushed(own, lab.where)
    lab.exclude(run, [3], "by the lab")
    own.exclude(run, [4], "by the rig")
    newer = a_run(own, 2)
    refused, sent = push_all(own, lab, unsent(own, lab))
    assert isinstance(refused, RecordError)
    assert run in str(refused)
    assert isinstance(sent, PushedRun)
    assert (sent.run, sent.how) == (newer, "pushed")


def test_a_run_of_an_older_program_has_one_identity_in_every_copy_of_its_record(
    own: Record, lab: Record, tmp_path: Path
) -> None:
    runs = [a_run(own, 1), a_run(own, 2)]
    with own.engine.begin() as to:
        to.exec_driver_sql("UPDATE runs SET uid = ''")
    copy = shutil.copytree(own.folder, tmp_path / "copy")
    assert [each.name for each in pushed(own, lab.where)] == runs
    with Record(Path(copy)) as another:
        assert unsent(another, lab) == []
        assert [push(another, lab, run).how for run in runs] == ["there", "there"]
    assert [run.run for run in lab.runs()] == runs[::-1]
