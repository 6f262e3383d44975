"""`rig doctor`: what is wrong with an installation, what goes to a maintainer, and what can be saved of a record."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest

from procedures.session import Pose, Reading
from rig.errors import RecordError
from rig.record import KeptPose, Record
from rig.record.recover import recover
from rig.services.health import without_secrets
from tests.rig.conftest import Rig
from tests.rig.test_store import begin, block

PAGE = 4096
ROOT = Path(__file__).parents[2]


def test_it_collects_versions_checks_runs_and_the_last_runs_log(rig: Rig, tmp_path: Path) -> None:
    with Record() as record:
        run = begin(record)
        record.log(run, 1.5, "run", "doing", "measuring")
        record.set_state(run, "failed", "alpha: stands still")
    archive = tmp_path / "doctor.zip"
    ended = rig("doctor", "--out", str(archive), "--json")
    document = ended.document
    assert (ended.status, document["schema"]) == (0, "rig.doctor/1")
    assert all(check["ok"] for check in document["checks"].values())
    with zipfile.ZipFile(archive) as file:
        assert sorted(file.namelist()) == document["files"] == ["checks.json", "run.json", "runs.json", "versions.json"]
        parts = {name: json.loads(file.read(name)) for name in file.namelist()}
    assert parts["versions.json"]["packages"]["numpy"]
    assert parts["runs.json"][0]["message"] == "alpha: stands still"
    assert parts["run.json"]["log"][0]["text"] == "measuring"
    assert b"samples" not in archive.read_bytes()


def test_without_any_run_all_checks_pass(rig: Rig, tmp_path: Path) -> None:
    ended = rig("doctor", "--out", str(tmp_path / "doctor.zip"))
    assert (ended.status, "there is no run yet" in ended.out) == (0, True)
    ended = rig("doctor", "--out", str(tmp_path / "again.zip"), "--json")
    assert (ended.status, all(check["ok"] for check in ended.document["checks"].values())) == (0, True)


@pytest.mark.slow
@pytest.mark.parametrize("package", ["numpy", "sqlalchemy", "yaml"])
def test_a_package_that_cannot_be_imported_is_named_in_an_archive(tmp_path: Path, package: str) -> None:
    (tmp_path / f"{package}.py").write_text("raise ImportError('a damaged file')")
    archive, words = tmp_path / "doctor.zip", "import sys; from rig.cli import main; main(sys.argv[1:])"
    before = os.environ.get("PYTHONPATH", "")
    ended = subprocess.run(
        [sys.executable, "-c", words, "doctor", "--out", str(archive), "--bench", str(tmp_path / "none.yaml")],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, [str(tmp_path), str(ROOT), before]))},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 1, ended.stderr
    assert "cannot be imported (ImportError: a damaged file); install it again" in ended.stdout
    with zipfile.ZipFile(archive) as file:
        assert set(file.namelist()) == {"bench.json", "checks.json", "run.json", "runs.json", "versions.json"}
        assert "error" in json.loads(file.read("bench.json"))


def test_the_archive_has_the_bench_without_passwords(rig: Rig, tmp_path: Path, bench_file: Any) -> None:
    archive = tmp_path / "doctor.zip"
    assert rig("doctor", "--bench", str(bench_file({})), "--out", str(archive)).status == 0
    with zipfile.ZipFile(archive) as file:
        assert "alpha" in json.loads(file.read("bench.json"))["instruments"]
    assert without_secrets({"a": [{"api_key": "x", "Password": "y", "token": 1, "keys": 2}]}) == {
        "a": [{"api_key": "***", "Password": "***", "token": "***", "keys": 2}]
    }


def recorded(folder: Path, poses: int = 60) -> str:
    """A run with poses that take a page each, and readings."""
    with Record(folder) as record:
        run = begin(record)
        for number in range(poses):
            volts = [[0.001 * k * k + number, 1.0] for k in range(400)]
            record.keep(run, number, KeptPose(Pose(90, number), block(volts), number, 21.5), None)
        record.keep_readings(run, [Reading("level-x", 0.02, "deg", 0.001)], None)
    return run


def test_a_sound_record_is_copied_completely(tmp_path: Path) -> None:
    run = recorded(tmp_path / "old")
    done = recover(tmp_path / "old" / "record.db", tmp_path / "new")
    assert (done.damaged, done.spoilt) == ((), ())
    with Record(tmp_path / "old") as old, Record(tmp_path / "new") as new:
        assert new.run(run) == old.run(run)
        assert new.readings(run) == old.readings(run)
        for a, b in zip(old.kept(run), new.kept(run), strict=True):
            assert (a.pose, a.samples.volts.tobytes()) == (b.pose, b.samples.volts.tobytes())


@pytest.mark.parametrize("page", [30, 45, 70])
def test_the_readable_rows_of_a_damaged_record_are_copied_and_the_losses_are_reported(
    rig: Rig, rig_home: Path, tmp_path: Path, page: int
) -> None:
    run = recorded(rig_home)
    sound = {number: kept.samples.volts.tobytes() for number, kept in _kept(rig_home, run).items()}
    path = rig_home / "record.db"
    data = bytearray(path.read_bytes())
    assert len(data) > (page + 4) * PAGE
    data[page * PAGE : (page + 4) * PAGE] = b"\xa5" * (4 * PAGE)
    path.write_bytes(data)
    checked = rig("doctor", "--out", str(tmp_path / "doctor.zip"))
    assert (checked.status, "WRONG  damaged: " in checked.out) == (1, True)
    ended = rig("doctor", "--recover", str(tmp_path / "new"), "--json")
    told = ended.document
    assert ended.status == 1
    assert told["lost"]
    found = _kept(tmp_path / "new", run)
    assert 10 < len(found) < len(sound)
    for number, kept in found.items():
        assert kept.samples.volts.tobytes() == sound[number], "what was read is what was kept"


def _kept(folder: Path, run: str) -> dict[int, KeptPose]:
    with Record(folder) as record:
        return {kept.number: kept for kept in record.kept(run) if kept.number is not None}


def test_a_recovery_does_not_replace_a_record_and_needs_a_readable_row(golden, tmp_path: Path) -> None:
    recorded(tmp_path / "old", 1)
    with golden.refused(RecordError):
        recover(tmp_path / "old" / "record.db", tmp_path / "old")
    (tmp_path / "letters").write_text("no database" * 1000)
    with golden.refused(RecordError):
        recover(tmp_path / "letters", tmp_path / "new")
