"""The commands of running and keeping, as a shell sees them: what they print, and their exit status."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from calibrations.importing.foreign import read_csv
from rig.bench import DEFAULT, read_bench
from rig.files import home
from tests.rig.conftest import Rig
from tests.rig.rigging import POSES, SMALL_ARGUMENTS

RUN = ("run", "sweep", "--unattended", *SMALL_ARGUMENTS)


def the_run(rig: Rig) -> str:
    return str(rig(*RUN, "--json").document["run"])


@pytest.mark.sockets
def test_a_run_is_listed_and_shown(rig: Rig) -> None:
    ended = rig(*RUN, "--json")
    document = ended.document
    assert ended.status == 0
    assert {key: document[key] for key in ("schema", "procedure", "state", "poses", "results")} == {
        "schema": "rig.run/1",
        "procedure": "sweep",
        "state": "complete",
        "poses": POSES,
        "results": {},
    }
    (listed,) = rig("runs", "--json").document["runs"]
    assert (listed["run"], listed["state"], listed["poses"]) == (document["run"], "complete", POSES)
    shown = rig("show", document["run"], "--json").document
    assert shown["settings"]["step_deg"] == 90
    assert shown["columns"]["alpha_deg"] == {"min": 45, "max": 90}
    assert shown["identities"]["adc"]["model"] == "LabJack T7"
    text = rig("show", document["run"]).out
    assert "complete" in text
    assert "answer mounting: yes" in text
    assert f", {POSES} poses" in text
    assert f"{POSES} poses" in rig("runs").out


def test_an_empty_record_says_how_to_begin(rig: Rig) -> None:
    assert rig("runs", "--json").document == {"schema": "rig.runs/1", "runs": []}
    assert "rig run sweep" in rig("runs").out


def test_settings_are_given_in_three_ways(rig: Rig) -> None:
    ways = (("--step-deg", "45"), ("--step-deg=45",), ("--set", "step_deg=45"))
    plans = [rig("plan", "sweep", *way, "--json").document for way in ways]
    assert [plan["poses"] for plan in plans] == [7 * 9 * 2] * 3


def test_a_plan_beyond_a_limit_is_bad_input_and_a_run_of_it_is_stopped(rig: Rig, tmp_path: Path) -> None:
    bench = tmp_path / "bench.yaml"
    default = (Path(__file__).parents[2] / "rig" / "bench" / "default.yaml").read_text(encoding="utf-8")
    bench.write_text(default.replace("limits_deg: [-400, 400]", "limits_deg: [-100, 400]", 1), encoding="utf-8")
    for command, status in (("plan", 2), ("run", 4)):
        ended = rig(command, "sweep", "--bench", str(bench), "--inclinations-deg", "-120")
        assert (ended.status, ended.out) == (status, "")
        assert "alpha: -120 deg is outside its limits -100 .. 400 deg; nothing was moved. Ask" in ended.err


def test_plan_prints_moves_limits_and_time(rig: Rig, rig_home: Path) -> None:
    ended = rig("plan", "sweep", *SMALL_ARGUMENTS)
    assert ended.status == 0
    assert "alpha from 0 to 90 deg\n" in ended.out
    assert "beta from -5 to 365 deg, within its limits -400 to 400 deg" in ended.out
    assert f"{POSES} poses in " in ended.out
    assert not rig_home.exists()


def test_procedures_are_listed(rig: Rig) -> None:
    assert "sweep" in rig("procedures").out
    document = rig("procedures", "--json").document
    (sweep,) = [each for each in document["procedures"] if each["name"] == "sweep"]
    assert sweep["settings"]["step_deg"] == 10
    assert "Source" in sweep["doc"]


@pytest.mark.sockets
def test_check_identifies_and_tests_every_instrument(rig: Rig) -> None:
    ended = rig("check", "--json")
    instruments = ended.document["instruments"]
    assert ended.status == 0
    assert set(instruments) == set(read_bench().instruments)
    assert instruments["adc"]["identity"]["model"] == "LabJack T7"
    assert "FAILED" not in rig("check").out


@pytest.mark.slow
@pytest.mark.sockets
def test_check_fails_for_an_instrument_that_does_not_answer(rig: Rig, bench_file: Callable[..., Path]) -> None:
    instruments = yaml.safe_load(DEFAULT.read_text())["instruments"]
    instruments["oven"]["url"] = "tcp://127.0.0.1:1"
    ended = rig("check", "--bench", str(bench_file({"instruments": instruments})))
    assert ended.status == 3
    (told,) = [line for line in ended.out.splitlines() if "FAILED" in line]
    assert told.startswith("oven")
    assert "oven (omega_cn7500) at tcp://127.0.0.1:1" in told
    assert "Check the address" in told
    assert all(role in ended.out for role in ("alpha", "beta", "adc"))


def test_the_example_bench_is_a_bench(rig: Rig, bench_file: Callable[..., Path]) -> None:
    assert bench_file(rig("check", "--example").out).read_text() == DEFAULT.read_text()


@pytest.mark.sockets
def test_answers_come_from_a_file(rig: Rig, tmp_path: Path) -> None:
    answers = tmp_path / "answers.yaml"
    answers.write_text("mounting: no")
    ended = rig(*RUN, "--answers", str(answers), "--json")
    run = ended.document
    assert (ended.status, run["state"], run["poses"]) == (4, "stopped", 0)
    assert 'can its cable turn freely?" is no; correct this' in ended.err.lower()
    answers.write_text("mounting: yes")
    assert rig("resume", run["run"], "--answers", str(answers), "--unattended").status == 0


@pytest.mark.parametrize("text", ["- a list", "a: ["])
def test_a_file_that_answers_nothing_is_refused(rig: Rig, tmp_path: Path, text: str) -> None:
    (tmp_path / "answers.yaml").write_text(text)
    ended = rig("run", "sweep", "--answers", str(tmp_path / "answers.yaml"))
    assert ended.status == 2
    assert "answers.yaml" in ended.err


@pytest.mark.sockets
def test_a_run_is_exported_as_the_table_that_analysis_reads(rig: Rig, tmp_path: Path) -> None:
    run = the_run(rig)
    ended = rig("export", run, "--out", str(tmp_path / "sweep.csv"), "--json")
    assert ended.document["rows"] == POSES
    table = read_csv(tmp_path / "sweep.csv")
    assert table.kind == "poses"
    assert table.labels["path"][0] == "A+ to B-"


@pytest.mark.sockets
def test_a_run_is_exported_as_events(rig: Rig, tmp_path: Path) -> None:
    run, path = the_run(rig), tmp_path / "sweep.jsonl"
    assert rig("export", run, "--format", "event-model", "--out", str(path)).status == 0
    documents = [json.loads(line) for line in path.read_text().splitlines()]
    assert [each["name"] for each in documents] == ["start", "descriptor", *["event"] * POSES, "stop"]
    start, descriptor, first, stop = (documents[k]["doc"] for k in (0, 1, 2, -1))
    assert start["uid"] == descriptor["run_start"] == stop["run_start"]
    assert first["descriptor"] == descriptor["uid"]
    assert set(first["data"]) == set(descriptor["data_keys"]) == set(first["timestamps"])
    assert descriptor["data_keys"]["vx_v"]["units"] == "V"
    assert (stop["exit_status"], stop["num_events"]) == ("success", {"primary": POSES})


@pytest.mark.sockets
@pytest.mark.parametrize(
    ("kind", "said"),
    [("parquet", "does not write parquet; use --format csv"), ("hdf5", "does not write hdf5; use --format csv")],
)
def test_an_unsupported_format_is_refused_and_nothing_is_written(
    rig: Rig, tmp_path: Path, kind: str, said: str
) -> None:
    ended = rig("export", "anything", "--format", kind, "--out", str(tmp_path / "x"))
    assert (ended.status, list(tmp_path.glob("*x*"))) == (2, [])
    assert said in ended.err


def test_a_table_is_not_written_under_the_ending_of_another_format(refused: Callable[..., str]) -> None:
    assert "give a name that ends in .csv" in refused("export", "good.csv", "--out", "good.xlsx")


@pytest.mark.parametrize("words", [("show", "nothing"), ("resume", "nothing"), ("compare", "nothing")])
def test_a_search_for_a_run_makes_no_record(rig: Rig, words: tuple[str, ...]) -> None:
    ended = rig(*words)
    assert ended.status == 2
    assert "no run 'nothing': there is no record yet in " in ended.err
    assert not list(home().rglob("record.db"))
