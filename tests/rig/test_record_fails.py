"""The disk, the folder or the file fails: what is committed stays, all that moves stops, and the message helps."""

from __future__ import annotations

import shutil
import sqlite3
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from rig.bench import read_bench
from rig.errors import RecordError
from rig.record import KeptPose, Record, file
from rig.runs.runner import resume, start
from tests.rig.misbehaving import looking_on
from tests.rig.rigging import POSES, SMALL_ARGUMENTS, Onlooker, small_sweep

pytestmark = pytest.mark.sockets
KEPT = 5  # poses before it fails


class Disturber(Onlooker):
    """Does something when so many poses are kept."""

    def __init__(self, harm: Callable[[], object]) -> None:
        super().__init__()
        self._harm = harm

    def kept(self, kept: KeptPose) -> None:
        super().kept(kept)
        if len(self.seen) == KEPT:
            self._harm()


def swept(record: Record, harm: Callable[[], object]) -> Any:
    return start(record, read_bench(), *small_sweep(), Disturber(harm))


def fill(record: Record) -> None:
    """The disk has no page left."""
    with closing(sqlite3.connect(record.path)) as connection:
        pages = connection.execute("PRAGMA page_count").fetchone()[0]
    record.engine.raw_connection().execute(f"PRAGMA max_page_count = {pages}")


def test_a_full_disk_stops_the_run_and_it_continues_when_there_is_space(tmp_path: Path) -> None:
    with Record(tmp_path) as record, looking_on() as aftermath:
        outcome = swept(record, lambda: fill(record))
        assert isinstance(outcome.error, RecordError)
        assert "the disk is full; free some space, then try again; `rig resume` continues a run" in str(outcome.error)
        assert str(record.path) in str(outcome.error)
        assert (aftermath.stops, aftermath.turning) == (1, [])
    with Record(tmp_path) as record:
        (run,) = record.runs()
        assert KEPT <= run.rows < POSES
        assert run.state == "failed"
        assert resume(record, run.run, Onlooker()).run.state == "complete"


def test_a_run_whose_end_does_not_fit_on_the_disk_is_not_called_running(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_state = Record.set_state

    def full(record: Record, run: str, state: str, *more: Any) -> None:
        if state != "running":
            raise RecordError("the disk is full")
        set_state(record, run, state, *more)

    with Record(tmp_path) as record:
        monkeypatch.setattr(Record, "set_state", full)
        outcome = swept(record, lambda: fill(record))
    assert (outcome.run.state, outcome.run.rows) == ("failed", KEPT)
    assert outcome.run.message == str(outcome.error)


def test_a_record_that_disappears_stops_the_run(tmp_path: Path) -> None:
    home, away = tmp_path / "home", tmp_path / "away"
    with Record(home) as record, looking_on() as aftermath:
        outcome = swept(record, lambda: shutil.move(home, away))
        assert isinstance(outcome.error, RecordError)
        assert "the record has disappeared (No such file or directory); put its folder back" in str(outcome.error)
        assert (outcome.run.state, aftermath.turning) == ("failed", [])
    with Record(away) as record:
        (run,) = record.runs()
        assert run.rows == KEPT
        assert resume(record, run.run, Onlooker()).run.state == "complete"


def test_a_record_that_is_exchanged_is_not_written_into(golden, tmp_path: Path) -> None:
    with Record(tmp_path) as record:
        outcome = swept(record, lambda: Path(shutil.copy(record.path, tmp_path / "new")).replace(record.path))
        golden.same(outcome.error)


@pytest.mark.parametrize("removed", [("-wal",), ("-wal", "-shm")])
def test_a_removed_write_ahead_log_loses_no_pose_and_is_reported(tmp_path: Path, removed: tuple[str, ...]) -> None:
    def remove() -> None:
        for side in removed:
            (tmp_path / f"record.db{side}").unlink()
        subprocess.run(
            [sys.executable, "-c", "import sqlite3, sys; sqlite3.connect(sys.argv[1]).execute('SELECT * FROM runs')",
             str(tmp_path / "record.db")], capture_output=True, check=False)  # fmt: skip

    with Record(tmp_path) as record:
        outcome = swept(record, remove)
        assert outcome.run.state == "complete"
        assert "removed the write-ahead log of the record during this command; all rows were saved" in str(
            outcome.run.message
        )
    with Record(tmp_path) as record:
        assert [kept.number for kept in record.kept(outcome.run.run)] == list(range(POSES))


def test_a_write_ahead_log_removed_after_the_last_pose_loses_no_pose(tmp_path: Path) -> None:
    with Record(tmp_path) as record:
        run = swept(record, lambda: None).run.run
        (tmp_path / "record.db-wal").unlink()
    assert len(record.remarks) == 1
    with Record(tmp_path) as record:
        assert len(list(record.kept(run))) == POSES


READS = """
import contextlib, io, os, sys, tempfile
from rig.cli import main
home = os.environ["RIG_HOME"]
os.environ["RIG_HOME"] = tempfile.mkdtemp()
with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
    with contextlib.redirect_stderr(io.StringIO()):
        main(sys.argv[1:])  # so that all is loaded by one who may read it
os.environ["RIG_HOME"] = home
if os.getuid() == 0:
    os.setgid(65534); os.setuid(65534)
main(sys.argv[1:])
"""


def as_nobody(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Call a command as a user who may write nowhere."""
    return subprocess.run(
        [sys.executable, "-c", READS, *arguments], capture_output=True, text=True, timeout=60, check=False
    )


@pytest.fixture
def read_only(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A record with a run, in a folder that may not be written.

    It is no folder of pytest: each start of pytest closes those to other users.
    """
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder) / "home"
        monkeypatch.setenv("RIG_HOME", str(home))
        with Record() as record:
            run = swept(record, lambda: None).run.run
        home.chmod(0o555)
        home.parent.chmod(0o755)
        yield run
        home.chmod(0o755)


@pytest.mark.slow
def test_a_read_only_record_is_read_and_a_run_into_it_is_refused(read_only: str) -> None:
    listed = as_nobody("runs")
    assert (listed.returncode, read_only in listed.stdout) == (0, True), listed.stderr
    refused = as_nobody("run", "sweep", *SMALL_ARGUMENTS, "--unattended")
    assert refused.returncode == 2
    assert "cannot be written: it is read-only; make file and folder writable" in refused.stderr
    assert "Traceback" not in refused.stderr


@pytest.mark.slow
def test_two_processes_write_one_record(rig_home: Path) -> None:
    words = [sys.executable, "-m", "rig", "run", "sweep", *SMALL_ARGUMENTS, "--unattended"]
    pipes: Any = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
    both = [subprocess.Popen(words, **pipes) for _ in range(2)]
    for each in both:
        said = each.communicate(timeout=120)[1]
        assert each.returncode == 0, said
    with Record() as record:
        first, second = record.runs()
        assert first.rows == second.rows == POSES
        a, b = ([kept.samples.volts.tobytes() for kept in record.kept(run.run)] for run in (first, second))
        assert a == b


def test_an_error_of_the_program_is_not_called_a_fault_of_the_disk(tmp_path: Path) -> None:
    with Record(tmp_path) as record, pytest.raises(Exception, match="no such table") as failed:
        record.engine.connect().exec_driver_sql("SELECT * FROM nowhere")
    assert not isinstance(failed.value, RecordError)
    assert set(file.FAILURES) >= {sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR}
