"""A digital sensor in every procedure: results, table, model and report have the unit of the sensor."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from calibrations.table import Table
from procedures.catalogue import paths
from rig.bench.file import DEFAULT
from rig.record import Record
from rig.record.measured import table_of
from tests.recorded import command
from tests.rig.conftest import Rig

OUTPUTS = "time ax ay az gx gy gz mx my mz supply d63 temperature"
COLUMNS = {name: k for k, name in enumerate(OUTPUTS.split(), 1)}
PER_G = {"g": 1.0, "m/s^2": 9.80665, "count": 16384.0}
VOLTS = re.compile(r"\b[munµ]?V\b(?!/min)")
SHORT = {  # settings that make a procedure short
    "sweep": ("--inclinations-deg", "90,30,150", "--step-deg", "90", "--dwell-s", "1", "--reference-every", "4"),
    "misalignment": ("--dwell-s", "1", "--target-deg", "0.05"),
    "soak": ("--duration-s", "2400", "--interval-s", "300", "--dwell-s", "1", "--off-s", "0"),
    "motion": ("--duration-s", "4", "--still-s", "2", "--block-s", "2", "--dwell-s", "0.5"),
    "noise-floor": ("--duration-s", "4", "--block-s", "2", "--dwell-s", "0.5"),
    "temperature-cycle": ("--temperatures-c", "30,35", "--dwell-s", "0.5", "--soak-s", "60"),
    "repeat": ("--times", "2", "--power", "false", "--mount", "false", "--dwell-s", "0.5"),
    "check-standard": (
        "--dwell-s",
        "0.5",
    ),
    "magnetometer-turn": ("--step-deg", "45", "--dwell-s", "0.5"),
    "rate-turn": ("--rates-deg-s", "40", "--rest-s", "2"),
    "level-check": (),
}


@pytest.fixture
def sensor_bench(tmp_path: Path) -> Callable[..., str]:
    """The bench file of the simulated rig with a digital sensor; `faults` are those of the sensor."""

    def write(driver: str, settings: Mapping[str, Any], *faults: dict[str, Any]) -> str:
        document = yaml.safe_load(DEFAULT.read_text(encoding="utf-8"))
        adc = {"driver": driver, "url": "simulated", "settings": settings, "faults": list(faults)}
        document["instruments"]["adc"] = adc
        path = tmp_path / f"{driver}.yaml"
        path.write_text(yaml.safe_dump(document), encoding="utf-8")
        return str(path)

    return write


@pytest.fixture
def digital(sensor_bench: Callable[..., str]) -> Callable[..., str]:
    """The bench file with a sensor that sends lines in a unit."""
    settings = {"columns": COLUMNS, "gyro_unit": "rad/s", "field_unit": "gauss", "rate_hz": 100}
    return lambda unit: sensor_bench("imu_lines", settings | {"unit": unit})


FRAMED = {  # drivers of sensors that send frames: the units of a table and of a magnetometer
    "mavlink_imu": ("m/s^2", "gauss"),
    "xsens_mti": ("m/s^2", "count"),
}
NEED_D63 = {"motion"}
PAGE = Path(__file__).parents[2] / "docs/how-to/digital.md"


@pytest.fixture
def framed(sensor_bench: Callable[..., str]) -> Callable[..., str]:
    """The bench file with a sensor that sends frames."""
    return lambda driver, *faults: sensor_bench(driver, {"rate_hz": 100, "most_lost": 0.05}, *faults)


def unit_expected(name: str, unit: str) -> set[str]:
    """The units that a result can have that depends on the unit of the outputs."""
    if name.startswith(("gyro-bias-x", "gyro-bias-y", "gyro-bias-z")):
        return {"rad/s"}
    if name.startswith("gyro-scale"):
        return {"rad/s/(deg/s)"}
    if name.startswith(("hard-iron", "field-total", "field-horizontal")):
        return {"gauss"}
    if re.fullmatch(r"noise-(rms|pp)-.|bias(-drift|-tolerance|-final|-as-is|-temperature-hysteresis)?-.", name):
        return {unit}
    if re.fullmatch(r"scale(-final)?-.", name):
        return {f"{unit}/g"}
    return {f"{unit}/K"} if name.startswith("bias-temperature-") else set()


@pytest.mark.slow
@pytest.mark.sockets
@pytest.mark.parametrize(
    ("procedure", "unit"),
    [*((name, "count") for name in sorted(SHORT)), ("check-standard", "m/s^2"), ("noise-floor", "m/s^2")],
)
def test_a_procedure_gives_its_results_in_the_unit_of_the_sensor(
    rig: Rig, rig_home: Path, digital: Callable[..., str], procedure: str, unit: str
) -> None:
    bench = digital(unit)
    ended = rig("run", procedure, "--bench", bench, "--unattended", "--json", *SHORT[procedure])
    assert ended.status in (0, 1), ended.err
    results = ended.document["results"]
    for name, result in results.items():
        assert result["unit"] not in ("V", "V/g", "V/K", "V/h"), name
        assert not (expected := unit_expected(name, unit)) or result["unit"] in expected, name
    assert not VOLTS.search(ended.err)
    for axis in "xyz":
        if (scale := results.get(f"scale-{axis}")) is not None:
            assert scale["value"] == pytest.approx(PER_G[unit], rel=0.1)


@pytest.mark.slow
@pytest.mark.sockets
@pytest.mark.parametrize("driver", list(FRAMED))
@pytest.mark.parametrize("procedure", sorted(SHORT.keys() - NEED_D63))
def test_a_procedure_runs_with_each_digital_sensor(
    rig: Rig, rig_home: Path, framed: Callable[..., str], procedure: str, driver: str
) -> None:
    ended = rig("run", procedure, "--bench", framed(driver), "--unattended", "--json", *SHORT[procedure])
    assert ended.status in (0, 1), ended.err
    results = ended.document["results"]
    unit, field = FRAMED[driver]
    for name, result in results.items():
        assert result["unit"] not in ("V", "V/g", "V/K", "V/h"), name
        expected = {u if u != "gauss" else field for u in unit_expected(name, unit)}
        assert not expected or result["unit"] in expected, name
    assert not VOLTS.search(ended.err)
    for axis in "xyz":
        if (scale := results.get(f"scale-{axis}")) is not None:
            assert scale["value"] == pytest.approx(9.80665, rel=0.1)


@pytest.mark.slow
@pytest.mark.sockets
@pytest.mark.parametrize("driver", list(FRAMED))
def test_a_few_poses_with_each_digital_sensor_keep_their_losses(
    rig: Rig, rig_home: Path, framed: Callable[..., str], driver: str
) -> None:
    faults = ({"what": "lost-message", "probability": 0.005}, {"what": "doubled-message", "probability": 0.02})
    bench = framed(driver, *faults)
    sweep = ("--inclinations-deg", "90", "--step-deg", "90", "--dwell-s", "2", "--reference-every", "0")
    ended = rig("run", "sweep", "--bench", bench, "--unattended", *sweep)
    assert ended.status == 0, ended.err
    with Record() as record:
        run = record.run("last").run
        counted = {reading.name: reading.value for reading in record.readings(run)}
        log = " ".join(line.text for line in record.lines(run, ["kept"]))
    for name in ("lost", "doubled"):
        assert counted[f"samples-{name}"] > 0
        assert sum(map(int, re.findall(rf"{name} (\d+)", log))) == counted[f"samples-{name}"]
    assert counted["messages-damaged"] == 0
    assert abs(counted["sensor-clock-gain"]) < 30


@pytest.mark.sockets
@pytest.mark.parametrize("driver", list(FRAMED))
def test_a_procedure_that_needs_another_input_is_refused(
    rig: Rig, rig_home: Path, framed: Callable[..., str], driver: str
) -> None:
    ended = rig("run", "motion", "--bench", framed(driver), "--unattended")
    assert ended.status not in (0, 70)
    assert "d63" in ended.err


@pytest.mark.sockets
@pytest.mark.parametrize("driver", list(FRAMED))
def test_a_check_shows_each_digital_sensor(rig: Rig, rig_home: Path, framed: Callable[..., str], driver: str) -> None:
    ended = rig("check", "--bench", framed(driver))
    assert ended.status == 0, ended.err
    assert "100 samples a second" in ended.out
    failed = rig("check", "--bench", framed(driver, {"what": "wrong-baud"}))
    assert failed.status == 3


@pytest.mark.sockets
@pytest.mark.parametrize("block", range(2))
def test_the_bench_files_of_the_how_to_page_are_checked(rig: Rig, rig_home: Path, tmp_path: Path, block: int) -> None:
    path = tmp_path / "bench.yaml"
    path.write_text(
        re.findall(r"```yaml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[block], encoding="utf-8"
    )
    ended = rig("check", "--bench", str(path))
    assert ended.status == 0, ended.err
    assert "100 samples a second" in ended.out


def test_every_procedure_is_tried_with_a_digital_sensor() -> None:
    by_hand = {"hand-positions", "hand-fields", "hand-turns"}  # tests/rig/test_hand_run.py
    assert {*SHORT, *by_hand} == set(paths())


@pytest.mark.slow
@pytest.mark.sockets
def test_table_model_and_noise_have_the_unit_of_the_sensor(
    rig: Rig, rig_home: Path, digital: Callable[..., str], tmp_path: Path
) -> None:
    settings = ("--inclinations-deg", "90,30,150", "--step-deg", "90", "--dwell-s", "0.5")
    assert rig("run", "sweep", "--bench", digital("count"), "--unattended", *settings).status == 0
    file, model = tmp_path / "sweep.csv", tmp_path / "model.yaml"
    assert rig("export", "last", "--format", "csv", "--out", str(file)).status == 0
    text = file.read_text(encoding="utf-8")
    assert "# unit: count\n" in text
    assert ",ax,ay,az," in text
    assert ",ax_std,ay_std,az_std," in text
    fitted = rig("fit", str(file), "--model", "linear", "--out", str(model))
    assert re.search(r"scale +x +1[67]\d{3}\(\d+\) count/g", fitted.out)
    assert not VOLTS.search(fitted.out)
    assert yaml.safe_load(model.read_text(encoding="utf-8"))["unit"] == "count"
    assert " count " in rig("compare", "last", "--model", str(model)).out
    poses = rig("show", "last", "--poses", "--json").document["kept"]
    assert set(poses[0]["means_v"]) == {"supply", "d63"}
    assert set(poses[0]["means"]) == {"ax", "ay", "az"}
    assert poses[0]["units"] == {"ax": "count", "ay": "count", "az": "count"}


@pytest.mark.sockets
def test_lost_and_doubled_samples_and_the_clock_are_in_the_record(
    rig: Rig, rig_home: Path, digital: Callable[..., str]
) -> None:
    path = Path(digital("g"))
    document = yaml.safe_load(path.read_text(encoding="utf-8"))
    document["instruments"]["adc"]["faults"] = [
        {"what": "lost-line", "probability": 0.004},
        {"what": "doubled-line", "probability": 0.01},
        {"what": "clock-drift", "size": 120},
    ]
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    ended = rig("run", "check-standard", "--bench", str(path), "--unattended", "--dwell-s", "4")
    assert ended.status == 0, ended.err
    with Record() as record:
        run = record.run("last").run
        counted = {reading.name: reading for reading in record.readings(run)}
        log = " ".join(line.text for line in record.lines(run, ["kept"]))
    lost, doubled = (counted[f"samples-{name}"].value for name in ("lost", "doubled"))
    assert counted["samples"].value == 8 * 400
    assert 3 <= lost <= 30
    assert 10 <= doubled <= 70
    assert counted["sensor-clock-gain"].value == pytest.approx(120, abs=30)
    assert sum(map(int, re.findall(r"lost (\d+)", log))) == lost
    assert sum(map(int, re.findall(r"doubled (\d+)", log))) == doubled
    assert f"lost {lost:.0f}, doubled {doubled:.0f}, damaged 0" in ended.err
    assert "digital sensor" in rig("show", "last").out


ANALOG = {"channels": {"vx": 0, "vy": 1, "vz": 2}, "rate_hz": 1000}  # the same sensor behind a converter
ATTITUDES = ("--inclinations-deg", "60,150", "--step-deg", "90", "--dwell-s", "0.5")


def in_attitudes(folder: Path, driver: str, **settings: Any) -> Table:
    """The poses of a sweep on an ideal rig with this converter or digital sensor."""
    document = yaml.safe_load(DEFAULT.read_text(encoding="utf-8")) | {"world": {"preset": "ideal"}}
    document["instruments"]["adc"] = {"driver": driver, "url": "simulated", "settings": settings}
    path = folder / f"{driver}.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    status, _, problem = command("run", "sweep", "--bench", str(path), "--unattended", *ATTITUDES)
    assert status == 0, problem
    with Record() as record:
        return table_of(record, "last")


@pytest.fixture(scope="module")
def analog(tmp_path_factory: pytest.TempPathFactory) -> Table:
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("analog")
        patch.setenv("RIG_HOME", str(folder))
        return in_attitudes(folder, "labjack_t7", **ANALOG)


@pytest.mark.sockets
@pytest.mark.parametrize("driver", ["imu_lines", *FRAMED])
def test_a_digital_sensor_has_the_specific_force_of_the_analog_one_on_each_axis(
    analog: Table, rig_home: Path, tmp_path: Path, driver: str
) -> None:
    digital = in_attitudes(tmp_path, driver, rate_hz=100)
    assert digital.axes == analog.axes == ("x", "y", "z")
    per_g = 1.0 if driver == "imu_lines" else 9.80665
    np.testing.assert_allclose(digital.outputs / per_g, analog.outputs - 2.5, atol=2e-3)
    alpha, beta = np.radians(digital.column("alpha_deg")), np.radians(digital.column("beta_deg"))
    force_g = np.column_stack([np.sin(alpha) * np.cos(beta), np.sin(alpha) * np.sin(beta), np.cos(alpha)])
    np.testing.assert_allclose(digital.outputs / per_g, force_g, atol=0.07)


@pytest.mark.sockets
@pytest.mark.parametrize("driver", ["imu_lines", *FRAMED])
@pytest.mark.parametrize("oven", [True, False])
def test_the_temperature_of_a_pose_is_what_the_sensor_reports(
    rig: Rig, rig_home: Path, tmp_path: Path, driver: str, oven: bool
) -> None:
    document = yaml.safe_load(DEFAULT.read_text(encoding="utf-8"))
    document["world"] = {"heat": {"package_rise_k": 9.0, "ambient_wander_k": 0.0}}
    settings = {"columns": {"ax": 1, "ay": 2, "temperature": 4}} if driver == "imu_lines" else {}
    document["instruments"]["adc"] = {"driver": driver, "url": "simulated", "settings": settings | {"rate_hz": 100}}
    if not oven:
        del document["instruments"]["oven"]
    path = tmp_path / "bench.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    sweep = ("--inclinations-deg", "90", "--step-deg", "180", "--dwell-s", "0.5")
    assert rig("run", "sweep", "--bench", str(path), "--unattended", *sweep).status == 0
    with Record() as record:
        warm_c = table_of(record, "last").column("temperature_c")
    np.testing.assert_allclose(warm_c, 22.0 + 6.0 + 9.0, atol=0.05)  # room, board and package
