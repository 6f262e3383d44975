"""The lab's record as people meet it: commands by URL, roles, a lab that is away, versions, passwords nobody sees."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from rig.bench import read_bench
from rig.cli import rig as commands
from rig.cli.terminal.options import OPTION
from rig.errors import RecordError
from rig.files import LAB, RECORD
from rig.lab_url import has_password, lab_url
from rig.record import Record
from rig.record.lab import prepare
from rig.record.push import push
from rig.record.schema import SCHEMA
from rig.web.desk import runs as runs_of_workbench
from tests.rig.conftest import WORD, Rig
from tests.rig.cutting import after_bytes, wire
from tests.rig.postgres import Server, free_port
from tests.rig.pushing import a_run, held
from tests.rig.rigging import POSES, SMALL_ARGUMENTS

SWEEP = ("run", "sweep", *SMALL_ARGUMENTS, "--unattended")


@pytest.fixture
def writer(people: Server, database: str, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("PGPASSWORD", WORD)
    return people.url(database, "rig7")


@pytest.fixture
def reader(people: Server, database: str, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("PGPASSWORD", WORD)
    return people.url(database, "anna")


@pytest.mark.slow
def test_an_imported_table_reads_the_same_from_the_lab(
    rig: Rig, work: Path, writer: str, reader: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = rig("import", "good.csv", "--kind", "poses", "--constant", "serial=17", "--json").done().document["run"]
    assert len(rig("push", "--to", writer, "--json").done().document["runs"]) == 1
    asked: Mapping[str, tuple[str, ...]] = {
        "runs": (),
        "show": (table,),
        "compare": (table,),
        "history": ("17",),
        "certificate": (table, "--model", "mine.yaml", "--out", "c.html", "--force"),
        "export": (table, "--out", "x.csv", "--force"),
    }
    own = {name: rig(name, *words, "--json") for name, words in asked.items()}
    exported = (work / "x.csv").read_bytes()
    monkeypatch.setenv("RIG_HOME", str(work / "elsewhere"))
    for name, words in asked.items():
        assert rig(name, *words, "--json", "--record", reader).done().document == own[name].done().document, name
    assert (work / "x.csv").read_bytes() == exported
    monkeypatch.setenv(RECORD, reader)
    assert [run.run for run in runs_of_workbench()] == [table]
    assert rig("runs").out.startswith("run ")


def test_every_command_that_reads_runs_takes_the_record() -> None:
    names = commands.list_commands(None)
    found = {name: commands.get_command(None, name) for name in names}
    takes = {name for name, each in found.items() if each and OPTION in each.params}
    reads = {n for n, c in found.items() if c and {p.name for p in c.params} & {"data", "run", "sensor", "request"}}
    assert reads - {"resume", "doctor"} <= takes
    assert not takes & {"run", "resume", "push", "demo", "simulate", "doctor"}


def denied(url: str, statement: str) -> str:
    """Why a role may not."""
    with Record(lab_url(url)) as lab, pytest.raises(RecordError) as error:
        lab.engine.connect().exec_driver_sql(statement)
    return str(error.value)


def test_an_empty_password_counts_as_none() -> None:
    assert not has_password(lab_url("postgresql://postgres:@lab.example/rigs"))
    assert has_password(lab_url("postgresql://postgres:word@lab.example/rigs"))
    assert has_password(lab_url("postgresql://postgres@lab.example/rigs?sslpassword=word"))


@pytest.mark.usefixtures("work")
def test_a_user_with_read_permission_writes_nothing(reader: str, writer: str, rig: Rig) -> None:
    with Record() as own:
        run = a_run(own)
    refused = rig("push", "--to", reader)
    assert refused.status == 2
    assert "anna has no permission for this (permission denied for table" in refused.err
    assert rig("push", "--to", writer).status == 0
    for words in (("exclude", run, "3", "--reason", "no"), ("import", "good.csv", "--kind", "poses")):
        refused = rig(*words, "--record", reader)
        assert refused.status == 2
        assert "the owner can grant it rig_writer" in refused.err
    for table in ("runs", "poses", "blocks", "arrivals", "events", "log"):
        for statement in ("DELETE FROM {}", "UPDATE {} SET run = run", "INSERT INTO {} DEFAULT VALUES"):
            assert "permission denied" in denied(reader, statement.format(table))
    assert "permission denied" in denied(writer, "DELETE FROM poses")
    assert rig("exclude", run, "3", "--reason", "a lorry", "--record", writer).status == 0
    with Record(lab_url(reader)) as lab:
        assert lab.excluded(run) == {3: "a lorry"}


def test_a_rig_that_is_offline_pushes_its_runs_later(
    rig: Rig, bench_file: Callable[..., Path], server: Server, database: str
) -> None:
    away = f"postgresql://rig7@127.0.0.1:{free_port()}/rigs"
    bench = str(bench_file({"lab": {"url": away, "push": True}}))
    ended = rig(*SWEEP, "--bench", bench, "--json")
    run = ended.done().document["run"]
    assert f"not pushed: {away}: no connection to the lab's record (connection" in ended.err
    assert "nothing is lost, the next `rig push` continues" in ended.err
    assert rig("push", "--bench", bench).status == 2
    there = server.url(database)
    again = rig(*SWEEP, "--bench", str(bench_file({"lab": {"url": there, "push": True}})), "--json")
    assert f"{run}: pushed to {there}" in again.err
    with Record(lab_url(there)) as lab, Record() as own:
        assert [each.rows for each in lab.runs()] == [POSES] * 2
        assert held(lab, run) == held(own, run)
    assert rig("push", "--to", there).out == f"{there} has all finished runs\n"


def test_a_run_of_another_lab_is_resumed_at_home(rig: Rig, writer: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where runs are made, the lab is not asked, whatever the environment says."""
    monkeypatch.setenv(RECORD, writer)
    run = rig(*SWEEP, "--json").done().document["run"]
    assert rig("resume", run, "--json").done().document["state"] == "complete"
    assert rig("runs", "--json").done().document["runs"] == []


def test_a_password_is_stored_and_printed_nowhere(
    rig: Rig, people: Server, database: str, bench_file: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    with Record() as own:
        run = a_run(own)
    right = people.url(database, "rig7", WORD)
    monkeypatch.setenv(LAB, right)
    monkeypatch.setenv(RECORD, right)
    pushes = ((), ("--json",), ("--verify",), ("--prepare",), ("--help",), ("no-run",))
    shown = [rig("push", *words) for words in pushes]
    shown += [rig("show", each) for each in (run, "no-run")]
    assert [each.status for each in shown] == [0, 0, 0, 2, 0, 2, 0, 2], shown[6]
    for url in (
        right.replace("rig7", "nobody"),
        right.replace(f":{people.port}", f":{free_port()}"),
        right.replace(database, "nowhere"),
        right.replace(f"{WORD}@", f"{WORD}@{WORD}@"),
        right.replace(f":{people.port}", f":{WORD}"),
        right.replace("postgresql", "mysql"),
        f"{WORD}",
        f"{right}?sslmod=require",
    ):
        shown.append(rig("push", "--to", url))
        assert shown[-1].status == 2, shown[-1]
        monkeypatch.setenv(LAB, url)
        shown.append(rig("push"))
        assert shown[-1].status == 2, shown[-1]
    for lab in ({"url": right}, {"url": f"{people.url(database)}?password={WORD}"}, right, {"url": right, "user": 1}):
        shown.append(rig("push", "--bench", str(bench_file({"lab": lab})), "--to", right))
        shown.append(rig("check", "--bench", str(bench_file({"lab": lab}))))
        assert shown[-1].status == 2, shown[-1]
    for each in shown:
        assert WORD not in each.out + each.err
        assert "Traceback" not in each.err
    with Record(lab_url(right)) as record:
        assert WORD not in str([held(record, kept.run) for kept in record.runs()])


def test_the_configuration_of_a_run_does_not_include_the_lab(bench_file: Callable[..., Path]) -> None:
    lab = {"url": "postgresql://rig7@lab.example/rigs", "push": True}
    with_lab, without = (read_bench(bench_file({"lab": each})).configuration("sweep", {}) for each in (lab, None))
    assert with_lab == without


def test_a_database_is_prepared_once_and_brought_up_to_date(server: Server, rig: Rig) -> None:
    name = server.new_database()
    url = server.url(name)
    assert "there is no record yet; `rig push --prepare --to URL`" in rig("runs", "--record", url).err
    assert rig("push", "--prepare", "--to", url, "--json").done().document["before"] == 0
    assert "CREATE ROLE rig7 LOGIN PASSWORD '...' IN ROLE rig_writer" in rig("push", "--prepare", "--to", url).out
    with Record() as own, Record(lab_url(url)) as lab:
        run = a_run(own)
        push(own, lab, run)
    for table in ("runs", "poses", "readings", "blocks", "dwells", "columns"):
        server.sql(f"ALTER TABLE {table} DROP COLUMN checksum", name)
    server.sql("ALTER TABLE runs DROP COLUMN uid; DROP TABLE arrivals; COMMENT ON TABLE runs IS 'schema 6'", name)
    assert f"this record has an older schema (6 of {SCHEMA}); `rig push --prepare" in rig("runs", "--record", url).err
    assert prepare(lab_url(url)) == 6
    assert f"{run}  complete" in rig("runs", "--record", url).out
    server.sql(f"COMMENT ON TABLE runs IS 'schema {SCHEMA + 1}'", name)
    for words in (("runs", "--record", url), ("push", "--prepare", "--to", url)):
        assert f"of a newer version of this program (schema {SCHEMA + 1}" in rig(*words).err


def test_verify_names_the_changed_runs(rig: Rig, server: Server, database: str) -> None:
    with Record() as own:
        run = a_run(own)
    url = server.url(database)
    rig("push", run, "--to", url)
    assert rig("push", "--verify", "--to", url).out == "1 runs unchanged, 0 incomplete\n"
    rig("exclude", run, "3", "--reason", "no", "--record", url)
    ended = rig("push", "--verify", "--to", url, "--json")
    assert (ended.status, ended.document["changed"]) == (1, [run])


def test_a_cut_connection_to_the_lab_gives_one_message(server: Server, database: str) -> None:
    """The driver's own reports of a broken wire, of which there are several, are not a person's business."""
    with Record() as own:
        a_run(own)
    with wire(server.port, after_bytes(lambda: 60_000)) as cut:
        words = [sys.executable, "-m", "rig", "push", "--to", server.url(database, port=cut.port)]
        ended = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert len(ended.stderr.splitlines()) == 1
    assert "nothing is lost, the next `rig push` continues" in ended.stderr
