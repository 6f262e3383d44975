"""A process that is killed loses the pose in flight and nothing else; a signal leaves a run that can be resumed."""

from __future__ import annotations

import json

import pytest

from rig.bench import read_bench
from rig.record import Record
from rig.record.tables import table_of
from rig.runner import start
from tests.rig.rigging import POSES, SMALL_ARGUMENTS, Onlooker, in_own_process, signal_at, small_sweep

pytestmark = pytest.mark.sockets
Measured = tuple[str, list[bytes]]
ARGUMENTS = ("run", "sweep", "--unattended", "--json", *SMALL_ARGUMENTS)


def content(record: Record, run: str) -> Measured:
    """All that was measured: the table's digest, and every sample."""
    return table_of(record, run).digest, [kept.samples.volts.tobytes() for kept in record.kept(run)]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Measured:
    with Record(tmp_path_factory.mktemp("undisturbed")) as record:
        return content(record, start(record, read_bench(), *small_sweep(), Onlooker()).run.run)


def measured(run: str) -> Measured:
    with Record() as record:
        return content(record, run)


@pytest.mark.parametrize("pose", [1, 9])
def test_kill_9_inside_a_transaction_then_resume(pose: int, undisturbed: Measured) -> None:
    killed = in_own_process(*ARGUMENTS, harm=signal_at("blocks", pose, "SIGKILL"))
    assert killed.returncode == -9
    with Record() as record:
        (run,) = record.runs()
        assert (run.state, run.rows) == ("stopped", pose - 1)
    resumed = in_own_process("resume", run.run, "--unattended", "--json")
    assert resumed.returncode == 0, resumed.stderr
    assert json.loads(resumed.stdout)["state"] == "complete"
    with Record() as record:
        poses = record.poses(run.run)
    assert len(poses) == len(set(poses)) == POSES
    assert measured(run.run) == undisturbed


@pytest.mark.parametrize("table", ["states", "events"])
def test_kill_9_before_the_first_pose_then_resume(table: str, undisturbed: Measured) -> None:
    killed = in_own_process(*ARGUMENTS, harm=signal_at(table, 1, "SIGKILL"))
    assert killed.returncode == -9
    with Record() as record:
        (run,) = record.runs()
    assert in_own_process("resume", run.run, "--unattended").returncode == 0
    assert measured(run.run) == undisturbed


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_signal_ends_the_process_with_status_4_and_resume_finishes_the_run(name: str, undisturbed: Measured) -> None:
    stopped = in_own_process(*ARGUMENTS, harm=signal_at("blocks", 5, name))
    document = json.loads(stopped.stdout)
    assert (stopped.returncode, document["state"]) == (4, "stopped")
    assert f"stopped by {name}; `rig resume {document['run']}` goes on" in stopped.stderr
    assert "Traceback" not in stopped.stderr
    resumed = in_own_process("resume", document["run"], "--unattended", "--json")
    assert (resumed.returncode, json.loads(resumed.stdout)["state"]) == (0, "complete")
    assert measured(document["run"]) == undisturbed
