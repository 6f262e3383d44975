"""Fleets through Dask: whatever dies, nothing is lost and nothing worked out twice; bad files; the commands."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import uuid
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from threading import Event
from typing import Any
from unittest import mock

import dask
import psutil
import pytest
from distributed import Client, LocalCluster

from calibrations.importing.foreign import write_csv
from calibrations.model.file import dump_model, read_model
from drivers.clock import WallClock
from rig.errors import RigError
from rig.fleet.cluster import FleetError, connect_workers, run_tasks, start_client
from rig.fleet.discover import discover_fleet
from rig.fleet.members import Member, fleet_of
from rig.fleet.questions import Fleet
from rig.fleet.worker import Question, read_look, write_look
from rig.record import Record
from rig.runs.signals import stoppable
from tests.calibrations.fleets import Flaw, Rig, sensor

Command = Callable[..., Any]
LINEAR = dump_model(read_model("linear"))
START = Question("look", LINEAR)
STEP = "a step"
RIGS = {"a": Rig(), "b": Rig(wave=0.06), "c": Rig()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fleet of 12: one of three rigs is off, one sensor follows temperature, one file is none, one is missing."""
    made = tmp_path_factory.mktemp("fleet")
    lines = ["sensor,batch,rig,file"]
    for k in range(12):
        rig = "abc"[k % 3]
        write_csv(sensor(900 + k, Flaw(warmth=1e-3 * (k == 4)), RIGS[rig]), made / f"{k}.csv")
        lines.append(f"S{k},L7,{rig},{k}.csv")
    (made / "bad.csv").write_text("alpha_deg,beta_deg,vx_v\n1,2,x\n")
    (made / "fleet.csv").write_text("\n".join([*lines, "BAD,L7,a,bad.csv", "GONE,L7,a,gone.csv", ""]))
    return made


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("record")


@pytest.fixture
def discovered(
    cluster: LocalCluster, folder: Path, home: Path, rig: Command, monkeypatch: pytest.MonkeyPatch
) -> dict[str, Any]:
    """What `rig fleet discover` says of it; after the first time out of the record."""
    monkeypatch.setenv("RIG_HOME", str(home))
    address = cluster.scheduler_address
    ended = rig("fleet", "discover", str(folder), "--scheduler", address, "--force", "--out", str(home / "guide"),
                "--report", str(home / "fleet.html"), "--json")  # fmt: skip
    return ended.done().document


def test_the_rig_in_error_and_the_strange_sensor_are_found_and_bad_files_are_listed(
    discovered: Mapping[str, Any], folder: Path, home: Path
) -> None:
    assert discovered["schema"] == "rig.fleet/1"
    of = {each["sensor"]: each for each in discovered["sensors"]}
    beyond = [(e["rig"], e["effect"], e["parameter"]) for e in discovered["rigs"] if e["beyond"]]
    assert beyond == [("b", "stage-eccentricity", "sine")]
    assert of["S4"]["own"] == ["temperature-bias"]
    assert of["S4"]["judged"] == "in full"
    assert {name for name, each in of.items() if each["verdict"] == "failed"} == {"BAD", "GONE"}
    assert of["BAD"]["remark"].startswith(str(folder / "bad.csv") + ", line 2")
    assert "gone.csv" in of["GONE"]["remark"]
    assert [name for name, each in of.items() if each["needs_a_person"]] == ["S4", "BAD", "GONE"]
    page = (home / "fleet.html").read_text()
    assert "http" not in page.replace("http://www.w3.org", "")
    assert all(word in page for word in ("stage-eccentricity", "S4", "temperature-bias", "gone.csv"))


def test_answers_in_the_record_are_not_computed_again(
    discovered: Mapping[str, Any], folder: Path, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rig.fleet.questions.run_tasks", lambda *_: pytest.fail("asked again"))
    members = [m for m in fleet_of([str(folder)]) if m.sensor not in ("BAD", "GONE")]
    with Record(home) as record:
        again = discover_fleet(Fleet(None, record, lambda *_: None), members, START)
    assert [each.verdict for each in again.sensors] == [each["verdict"] for each in discovered["sensors"][:12]]


def test_calibrate_uses_the_discovered_models_and_writes_one_for_each_sensor(
    discovered: Mapping[str, Any], cluster: LocalCluster, folder: Path, home: Path, rig: Command
) -> None:
    address = cluster.scheduler_address
    ended = rig("fleet", "calibrate", str(folder), "--scheduler", address, "--model", str(home / "guide"),
                "--out", str(home / "models"), "--report", str(home / "calibrated.html"), "--json")  # fmt: skip
    document = ended.document
    (batch,) = document["batches"]
    assert len(batch["sensors"]) == 12
    assert {each["sensor"] for each in document["failed"]} == {"BAD", "GONE"}
    assert [each["sensor"] for each in batch["sensors"] if each["stands_out"]] == ["S4"]
    for parameter in batch["sensors"][1]["parameters"]:
        assert parameter["interval"][0] < parameter["value"] < parameter["interval"][1]
        assert parameter["std"] <= 1.05 * parameter["std_alone"]
    model = read_model(home / "models" / "S1.yaml")
    assert model.terms[0].estimates[0].value == batch["sensors"][1]["parameters"][0]["value"]
    assert (home / "calibrated.html").stat().st_size > 5_000


def test_answers_are_stored_as_they_arrive(cluster: LocalCluster, folder: Path, tmp_path: Path) -> None:
    """Who is stopped in the middle, or loses the scheduler, goes on where the last answers came."""
    members = [m for m in fleet_of([str(folder)]) if m.fault is None][:3]
    asked = [(member, Question("diagnosis", LINEAR)) for member in members]
    with Client(cluster) as client, Record(tmp_path) as record, pytest.MonkeyPatch.context() as patch:
        patch.setitem(__import__("rig.fleet.questions").fleet.questions.CHUNK, "diagnosis", 1)
        stopped = Fleet(client, record, lambda *_: None).ask(asked, STEP)
        first, _ = next(stopped)
        stopped.close()
        left: list[list[Any]] = []
        patch.setattr("rig.fleet.questions.run_tasks", lambda _client, _work, chunks: left.extend(chunks) or [])
        again = [member for member, _ in Fleet(client, record, lambda *_: None).ask(asked, STEP)]
    assert again == [first]
    assert sum(map(len, left)) == 2


def fragile(tasks: list[int]) -> list[int]:
    """Work that kills its process at 1."""
    if 1 in tasks:
        os.kill(os.getpid(), signal.SIGKILL)
    return tasks


@pytest.mark.slow
def test_a_task_that_kills_its_worker_fails_alone_and_all_others_are_computed() -> None:
    with mock.patch.dict(os.environ), connect_workers(None, 1) as client:  # Dask sets variables for its workers here
        found = list(run_tasks(client, fragile, iter([[0, 1], [], [2, 3], [4]])))
    assert sorted(task for chunk, _ in found for task in chunk) == [0, 1, 2, 3, 4]
    assert [chunk for chunk, said in found if said is None] == [[1]]
    assert all(said == chunk for chunk, said in found if said is not None)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "started"),
    [(signal.SIGINT, False), (signal.SIGTERM, False), (signal.SIGTERM, True), (signal.SIGHUP, True)],
)
def test_a_signal_ends_a_fleet_with_one_message(number: signal.Signals, started: bool, folder: Path) -> None:
    """A terminal sends it to all processes of the command; none of them complains or leaves semaphores behind."""
    with subprocess.Popen(
        [sys.executable, "-m", "rig", "fleet", "discover", str(folder), "--workers", "1"],
        stderr=subprocess.PIPE, text=True, start_new_session=True,
    ) as command:  # fmt: skip
        assert command.stderr
        first = command.stderr.readline()
        if started:
            first += command.stderr.readline()
        else:
            while len(psutil.Process(command.pid).children()) < 2:  # one is multiprocessing's own
                WallClock().sleep(0.02)
        os.kill(command.pid if number == signal.SIGTERM else -command.pid, number)
        said = command.stderr.read()
    assert "sensors of" in first
    assert [line for line in said.splitlines() if not line.startswith("searching")] == ["rig: stopped"]
    assert command.returncode == 4


def test_a_signal_while_the_client_makes_its_name_is_not_lost(
    cluster: LocalCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The standard library discards every exception where a name is made from the address of the network."""
    make_name = uuid.uuid1

    def interrupted_name(*arguments: Any, **options: Any) -> uuid.UUID:
        with suppress(BaseException):
            signal.raise_signal(signal.SIGINT)
        return make_name(*arguments, **options)

    monkeypatch.setattr(uuid, "uuid1", interrupted_name)
    with pytest.raises(KeyboardInterrupt, match="SIGINT"), stoppable(), start_client(cluster):
        Event().wait(30)  # the signal ends it


def test_no_scheduler_is_one_message(rig: Command, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.fleet.cluster.PATIENCE_S", 0.2)
    ended = rig("fleet", "discover", str(folder), "--scheduler", "tcp://127.0.0.1:1")
    assert ended.status == 3
    assert "tcp://127.0.0.1:1: no scheduler answers" in ended.err


def numbered(tasks: list[int]) -> list[int]:
    return tasks


def test_the_message_about_a_lost_scheduler_says_how_to_continue() -> None:
    with (
        dask.config.set({"distributed.comm.timeouts.connect": "0.5 s"}),
        LocalCluster(
            n_workers=1, threads_per_worker=1, processes=False, protocol="tcp://", host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
        ) as lost,
        Client(lost.scheduler_address) as client,
    ):  # fmt: skip
        going_on = run_tasks(client, numbered, iter([[k] for k in range(50)]))
        next(going_on)
        lost.close()
        with pytest.raises(FleetError, match="run the same command again"):
            list(going_on)


def test_members_of_files_folders_and_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RIG_HOME", str(tmp_path / "home"))
    (tmp_path / "home").mkdir()
    write_csv(sensor(1), tmp_path / "one.csv")
    text = (tmp_path / "one.csv").read_text()
    (tmp_path / "two.csv").write_text(f"# serial: 17\n# batch: L8\n# rig: east\n{text}")
    with Record() as record:
        run = record.add_table(sensor(2))
    of = {m.sensor: m for m in fleet_of([str(tmp_path), run])}
    assert set(of) == {"one", "17", run}
    assert (of["17"].batch, of["17"].rig, of["one"].batch) == ("L8", "east", "")
    assert of[run].run
    assert of["one"].digest != of["17"].digest
    with pytest.raises(RigError, match="no such file or folder"):
        fleet_of(["nowhere"])
    (tmp_path / "index.csv").write_text("sensor,file\nS,one.csv\nS,two.csv\n")
    with pytest.raises(RigError, match="the sensor S occurs twice"):
        fleet_of([str(tmp_path / "index.csv")])
    (tmp_path / "index.csv").write_text("sensor,file,lot\nS,one.csv,1\n")
    with pytest.raises(RigError, match="not lot"):
        fleet_of([str(tmp_path / "index.csv")])


def test_a_screening_is_written_and_read_bit_for_bit() -> None:
    from calibrations.fleet.look import SharedDesigns, screen_sensor

    found = screen_sensor(sensor(1), read_model("linear"), SharedDesigns({}))
    document = json.dumps(write_look(found))
    assert json.dumps(write_look(read_look(json.loads(document)))) == document


def test_a_run_is_looked_at_by_its_worker(
    cluster: LocalCluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RIG_HOME", str(tmp_path))
    with Record() as record:
        run = record.add_table(sensor(3))
        (member,) = fleet_of([run])
        with Client(cluster) as client:
            ((asked, said),) = Fleet(client, record, lambda *_: None).ask([(member, Question("look", LINEAR))], STEP)
    assert isinstance(asked, Member)
    assert "fault" not in said
