"""Results: their verdicts, which allow for the uncertainty, and their meanings in words."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from calibrations.errors import DataError
from procedures.errors import ProcedureError
from rig.bench import DEFAULT
from rig.bench.result_names import RESULTS, label, meaning, names_with_limits
from rig.record import Record
from rig.record.measured import table_of
from rig.results import Result, documents, read_returned
from rig.results.evaluate import MODULES
from tests.rig.conftest import Rig


@pytest.mark.parametrize(
    ("value", "std", "limit", "verdict"),
    [
        (0.7, 0.1, 1.0, "pass"),
        (-0.7, 0.1, 1.0, "pass"),
        (0.9, 0.1, 1.0, "marginal"),
        (-1.1, 0.1, 1.0, "marginal"),
        (1.3, 0.1, 1.0, "fail"),
        (-1.3, 0.1, 1.0, "fail"),
        (0.0, 0.1, (0.5, 1.0), "fail"),
        (0.75, 0.1, (0.5, 1.0), "pass"),
        (1.0, None, 1.0, "pass"),
        (1.001, None, 1.0, "fail"),
    ],
)
def test_a_verdict_uses_the_uncertainty(value: float, std: float | None, limit: Any, verdict: str) -> None:
    assert Result(value, "V", std).verdict(limit) == verdict


def test_a_result_without_a_limit_has_no_verdict() -> None:
    document = documents({"a": Result(1.0, "V", 0.1), "b": Result(2.0, "V")}, {"b": 1.0})
    assert document["a"] == {"value": 1.0, "std": 0.1, "unit": "V", "limit": None, "verdict": None}
    assert (document["b"]["limit"], document["b"]["verdict"]) == (1.0, "fail")


@pytest.mark.parametrize("given", [3.0, {"value": 3.0}, {"value": "much", "unit": "g"}])
def test_an_invalid_result_is_refused(golden, given: Any) -> None:
    with golden.refused(ProcedureError):
        read_returned("mass", given)


def bench_with(folder: Path, **changes: Any) -> str:
    """The simulated rig with changed parts, as a file."""
    document = yaml.safe_load(DEFAULT.read_text())
    for part, change in changes.items():
        document[part] |= change
    path = folder / "bench.yaml"
    path.write_text(yaml.safe_dump(document))
    return str(path)


@pytest.mark.sockets
def test_the_noise_floor_is_that_of_the_world(rig: Rig, tmp_path: Path) -> None:
    world = {"preset": "ideal", "noise": {"white_v": 0.9e-3}}
    bench = bench_with(tmp_path, world=world, limits={"results": {"noise-pp-x": 0.004, "inclination-y": 0.01}})
    ended = rig("run", "noise-floor", "--duration-s", "20", "--bench", bench, "--unattended", "--json")
    results = ended.document["results"]
    assert ended.status == 1
    assert (results["noise-pp-x"]["verdict"], results["inclination-y"]["verdict"]) == ("pass", "fail")
    rms = results["noise-rms-x"]
    expected_v = np.hypot(0.9e-3, 20 / 2**16 / np.sqrt(12))  # and the converter's steps
    assert abs(rms["value"] - expected_v) < 4 * rms["std"] < 0.1 * expected_v
    assert results["noise-pp-x"]["value"] == pytest.approx(4 * rms["value"])
    hidden = np.degrees(np.arcsin(results["noise-pp-x"]["value"] / 1.0))
    assert results["inclination-x"]["value"] == pytest.approx(hidden, rel=0.05)
    assert {r["unit"] for r in results.values()} == {"V", "deg"}
    assert set(results) <= set(names_with_limits())


@pytest.mark.sockets
def test_a_still_record_is_a_table_of_samples_in_time(rig: Rig) -> None:
    ended = rig("run", "noise-floor", "--duration-s", "4", "--block-s", "1", "--unattended", "--json")
    with Record() as record:
        table = table_of(record, ended.document["run"])
    assert (table.kind, table.n) == ("still", 4000)
    assert np.allclose(np.diff(table.column("t_s")), 1e-3, atol=1e-9)
    assert "8 poses and blocks" in rig("runs").out


@pytest.mark.sockets
def test_the_level_check_finds_the_tilt_and_not_the_offset(rig: Rig, tmp_path: Path) -> None:
    world = {"preset": "ideal", "base": {"tilt_x_deg": 0.2, "tilt_y_deg": 0.1}}
    ended = rig("run", "level-check", "--bench", bench_with(tmp_path, world=world), "--unattended", "--json")
    results = ended.document["results"]
    assert ended.status == 0
    found = sorted(abs(results[f"level-{axis}"]["value"]) for axis in "xy")
    assert found == pytest.approx([0.1, 0.2], abs=0.02)
    assert all(results[f"level-{axis}"]["verdict"] == "pass" for axis in "xy")
    assert all(abs(results[f"level-offset-{axis}"]["value"]) < 0.1 for axis in "xy")
    assert set(results) <= set(names_with_limits())


@pytest.mark.sockets
@pytest.mark.parametrize("procedure", ["level-check", "noise-floor", "sweep"])
def test_a_table_that_is_not_level_refuses_to_start(rig: Rig, tmp_path: Path, procedure: str) -> None:
    bench = bench_with(tmp_path, world={"preset": "ideal", "base": {"tilt_x_deg": 0.5}})
    ended = rig("run", procedure, "--bench", bench, "--unattended", "--json")
    document = ended.document
    assert (ended.status, document["state"], document["poses"]) == (4, "stopped", 0)
    assert "level: the table is tilted by " in ended.err
    assert "limits.level_deg is 0.3; level the base" in ended.err
    with Record() as record:
        assert len(record.readings(document["run"])) == 4


@pytest.mark.sockets
def test_a_bench_without_a_level_has_it_read_and_typed(rig: Rig, tmp_path: Path) -> None:
    document = yaml.safe_load(DEFAULT.read_text())
    del document["instruments"]["level"]
    (tmp_path / "bench.yaml").write_text(yaml.safe_dump(document))
    shown = {"level-front-x": "0.05", "level-front-y": "0.11 deg", "level-back-x": "-0.03", "level-back-y": "-0,09"}
    (tmp_path / "answers.yaml").write_text(yaml.safe_dump(shown))
    files = ("--bench", str(tmp_path / "bench.yaml"), "--answers", str(tmp_path / "answers.yaml"))
    results = rig("run", "level-check", *files, "--unattended", "--json").document["results"]
    assert results["level-x"]["value"] == pytest.approx(0.04)
    assert results["level-y"]["value"] == pytest.approx(0.10)
    assert results["level-offset-y"]["value"] == pytest.approx(0.01)
    assert results["level-x"]["std"] is None


@pytest.mark.sockets
def test_a_run_whose_results_fail_is_complete(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    def cannot(*readings: object) -> None:
        raise DataError("the stretches are too short; measure longer")

    monkeypatch.setattr("rig.results.alignment.reversal", cannot)
    ended = rig("run", "level-check", "--unattended", "--json")
    document = ended.document
    assert (ended.status, document["state"], document["results"]) == (1, "complete", {})
    assert "results: none: the stretches are too short" in ended.err
    assert "results: none: the stretches are too short" in rig("show", document["run"]).out


@pytest.mark.parametrize("procedure", MODULES)
def test_each_result_of_a_procedure_has_a_meaning(procedure: str) -> None:
    assert RESULTS[procedure]
    for name in RESULTS[procedure]:
        assert meaning(procedure, name).endswith("."), name
        assert meaning(procedure, f"a1/{name}") == meaning(procedure, name)


def test_a_page_names_a_result_by_its_meaning_with_axis_and_sensor() -> None:
    assert label("soak", "bias-drift-x") == "Change of the bias over the soak, axis x"
    assert label("soak", "a1/gap") == "a1: Total time without samples"
    assert label("misalignment", "alpha-y") == "Angle alpha from the reference axis to sensing axis y"
    assert label("mine", "loudness") == "loudness"


def test_the_meaning_of_a_result_names_its_axes() -> None:
    assert meaning("misalignment", "theta-xz") == "Component of sensing axis x along reference axis z."
    assert meaning("hand-positions", "uncertainty") != meaning("hand-fields", "uncertainty")


def test_a_result_of_a_users_procedure_has_none() -> None:
    assert meaning("my-own", "a1/my-own-result") == ""
