"""A batch: up to four sensors, eight axes, in one run; each gets its own calibration."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from rig.bench import DEFAULT
from rig.record import Record
from rig.record.measured import table_of
from tests.rig.conftest import Rig

NAMES = ("a1", "a2", "a3", "a4")
TURNED_DEG = {"a1": 0.0, "a2": 2.0, "a3": -3.0, "a4": 1.0}
SWEEP = ("--inclinations-deg", "90,30,150", "--step-deg", "30", "--dwell-s", "1", "--unattended", "--json")


def document() -> dict[str, Any]:
    """The simulated rig with four sensors that are turned differently on the table."""
    found = yaml.safe_load(DEFAULT.read_text())
    del found["sensor"]
    found["sensors"] = {
        name: {
            "name": "ADXL203",
            "serial": f"S{k}",
            "filter_corner_hz": 15.07,
            "world": {"sensor": {"package": {"turn_z_deg": TURNED_DEG[name]}}},
        }
        for k, name in enumerate(NAMES)
    }
    outputs = [f"{name}.{output}" for name in NAMES for output in ("vx", "vy")]
    settings = found["instruments"]["adc"]["settings"]
    del settings["on_request"]  # their inputs are taken
    settings["channels"] = {name: k for k, name in enumerate([*outputs, "supply", "d63"])}
    found["world"] = {"preset": "ideal", "spread": {"imperfection_fraction": 0}}
    return found


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A record with a sweep of the batch, and the bench file."""
    from rig.cli import main

    folder = tmp_path_factory.mktemp("batch")
    bench = folder / "batch.yaml"
    bench.write_text(yaml.safe_dump(document()))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RIG_HOME", str(folder / "home"))
        with pytest.raises(SystemExit) as ended:
            main(("run", "sweep", "--bench", str(bench), *SWEEP))
    assert not ended.value.code
    return folder / "home", bench


@pytest.fixture
def run(swept: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> str:
    """The sweep's id, in the record that commands use."""
    monkeypatch.setenv("RIG_HOME", str(swept[0]))
    with Record() as record:
        return record.runs()[0].run


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_each_sensor_gets_its_own_calibration(rig: Rig, run: str, tmp_path: Path, name: str) -> None:
    ended = rig("fit", f"{run}/{name}", "--model", "physical", "--out", str(tmp_path / "model.yaml"), "--json")
    found = {(p["effect"], p["name"]): p for p in ended.done().document["parameters"]}
    turned = found["axis-misalignment", "z"]
    assert turned["value"] == pytest.approx(-TURNED_DEG[name], abs=4 * turned["std"] + 0.01)


def test_each_sensor_of_a_batch_has_a_table_with_its_serial_number(run: str) -> None:
    with Record() as record:
        tables = [table_of(record, f"{run}/{name}") for name in NAMES]
    assert [table.constants["serial"] for table in tables] == ["S0", "S1", "S2", "S3"]
    assert {table.axes for table in tables} == {("x", "y")}
    assert len({table.digest for table in tables}) == 4
    for table in tables[1:]:
        np.testing.assert_array_equal(table.column("temperature_c"), tables[0].column("temperature_c"))


def test_a_run_of_a_batch_needs_the_sensors_name(rig: Rig, run: str) -> None:
    ended = rig("compare", run)
    assert ended.status == 2
    assert f"has the sensors a1, a2, a3, a4; choose one, such as {run}/a1" in ended.err


def test_a_sensor_that_is_not_there_is_named_with_the_nearest(rig: Rig, run: str) -> None:
    ended = rig("compare", f"{run}/a11")
    assert ended.status == 2
    assert "has no sensor 'a11'. Did you mean 'a1'?" in ended.err


def test_results_carry_the_sensors_name(rig: Rig, swept: tuple[Path, Path], tmp_path: Path) -> None:
    found = document()
    found["limits"]["results"] = {"noise-pp-x": 0.004}
    bench = tmp_path / "limited.yaml"
    bench.write_text(yaml.safe_dump(found))
    ended = rig("run", "noise-floor", "--duration-s", "20", "--bench", str(bench), "--unattended", "--json")
    results = ended.done().document["results"]
    assert {f"{name}/noise-rms-{axis}" for name in NAMES for axis in "xy"} <= set(results)
    assert {results[f"{name}/noise-pp-x"]["verdict"] for name in NAMES} == {"pass"}


@pytest.mark.slow
def test_a_search_goes_by_the_first_and_finds_all(rig: Rig, swept: tuple[Path, Path]) -> None:
    ended = rig("run", "misalignment", "--dwell-s", "1", "--bench", str(swept[1]), "--unattended", "--json")
    results = ended.done().document["results"]
    for name in NAMES:
        assert abs(results[f"{name}/beta-x"]["value"]) == pytest.approx(abs(TURNED_DEG[name]), abs=0.05)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sensor": {"serial": "S9"}}, "key sensor: the file also has a batch in `sensors`"),
        ({"sensors": {"a1": {}, "a2": {}, "a3": {}}}, "no sensor 'a4' in `sensors`. Did you mean 'a"),
        ({"sensors": {**{n: {} for n in NAMES}, "a5": {}}}, "key sensors.a5: the adc has no channel a5.vx"),
        ({"sensors": {**{n: {} for n in NAMES}, "a1": {"world": {"heat": {"ambient_c": 9}}}}}, "shared by all"),
        ({"sensors": {**{n: {} for n in NAMES}, "a/5": {}}}, "key sensors.a/5"),
    ],
)
def test_sensors_and_channels_must_fit_together(rig: Rig, tmp_path: Path, change: dict[str, Any], message: str) -> None:
    bench = tmp_path / "bad.yaml"
    bench.write_text(yaml.safe_dump(document() | change))
    ended = rig("plan", "sweep", "--bench", str(bench))
    assert ended.status == 2
    assert message in ended.err
