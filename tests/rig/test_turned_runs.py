"""rate-turn and magnetometer-turn on the simulated bench, every byte on a socket: from the run to the effect."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from calibrations.importing.foreign import read_csv
from drivers.errors import StageAlarm
from drivers.oriental_az.driver import RotaryStage
from procedures.catalogue import find
from procedures.settings import parse
from rig.bench import DEFAULT, read_bench
from rig.record import Record
from rig.record.measured import RATE, table_of
from rig.runs.runner import start
from tests.rig.conftest import Rig
from tests.rig.rigging import Onlooker

FIELD = ("magnetometer-turn", "--step-deg", "45", "--dwell-s", "0.1", "--settle-s", "0.1", "--unattended", "--json")
RATES = ("rate-turn", "--rates-deg-s", "80", "--rest-s", "0.5", "--unattended", "--json")
ONE = ("--mounts", "1")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record that this file's runs share, and the simulated rig with quick stages: simulated time is not free."""
    folder = tmp_path_factory.mktemp("turned")
    bench = yaml.safe_load(DEFAULT.read_text(encoding="utf-8"))
    for role in ("alpha", "beta"):
        bench["instruments"][role]["settings"] |= {"speed_deg_s": 180, "acceleration_deg_s2": 600}
    del bench["limits"]["level_deg"]
    bench["sensor"]["heading_deg"] = 25.0
    (folder / "quick.yaml").write_text(yaml.safe_dump(bench), encoding="utf-8")
    return folder


@pytest.fixture(autouse=True)
def shared(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RIG_HOME", str(folder))


def run(rig: Rig, folder: Path, arguments: tuple[str, ...]) -> dict[str, Any]:
    """What a run gave; one of the same arguments is not done again."""
    kept = folder / f"{'_'.join(arguments)}.json"
    if not kept.exists():
        ended = rig("run", *arguments, "--bench", str(folder / "quick.yaml"))
        assert ended.status == (1 if "no hard-iron" in ended.err else 0), ended.err
        kept.write_text(ended.out)
    return dict(json.loads(kept.read_text()))


@pytest.mark.sockets
def test_a_magnetometer_is_calibrated_by_the_ellipsoid_and_by_hand(rig: Rig, folder: Path) -> None:
    """The field of the simulated laboratory is 52.4 uT, dips by 66.8 deg, and stands 34.3 deg before the base's x."""
    found = run(rig, folder, FIELD)["results"]
    assert found["field-inclination"]["value"] == pytest.approx(66.8, abs=0.2)
    assert found["field-azimuth"]["value"] == pytest.approx(-34.3, abs=0.4)
    declination, azimuth = found["field-declination"], found["field-azimuth"]
    assert declination["value"] == pytest.approx(25.0 + azimuth["value"], abs=1e-9)  # of the base, from true north
    assert declination["std"] == azimuth["std"]
    assert found["field-total"]["value"] == pytest.approx(52.4 * 0.02, rel=0.01)
    horizontal = found["field-total"]["value"] * np.cos(np.radians(found["field-inclination"]["value"]))
    assert found["field-horizontal"]["value"] == pytest.approx(horizontal, rel=1e-6)
    for axis in "xyz":
        ellipsoid, by_hand = found[f"hard-iron-{axis}"], found[f"hard-iron-by-hand-{axis}"]
        assert 0 < ellipsoid["std"] < 5e-4
        assert by_hand["value"] == pytest.approx(ellipsoid["value"], abs=0.005)
    assert -90 <= found["soft-iron-angle-by-hand"]["value"] <= 90
    assert found["left-by-ellipsoid"]["value"] < 0.5 < 5 < found["left-by-hand"]["value"]
    assert all(each["verdict"] is None for each in found.values())


@pytest.mark.sockets
def test_one_horizontal_turn_names_the_parameters_that_it_cannot_show(rig: Rig, folder: Path) -> None:
    arguments = (*FIELD, *ONE, "--over", "no")
    document = run(rig, folder, arguments)
    assert set(document["results"]) == {
        *("hard-iron-by-hand-x", "hard-iron-by-hand-y", "soft-iron-by-hand", "soft-iron-angle-by-hand", "left-by-hand"),
        *("field-horizontal-by-hand", "field-azimuth-by-hand"),
    }
    assert document["results"]["field-azimuth-by-hand"]["value"] == pytest.approx(-34.3, abs=5.0)
    told = rig("show", document["run"]).out  # and its exit status is 1
    assert "no hard-iron-x, hard-iron-y, " in told
    assert "or left-by-ellipsoid: hard-iron and soft-iron cannot be tested: the orientations cover too little" in told
    assert told.count("cover too little") == 1  # for all of them
    assert "no hard-iron-by-hand-z: z was vertical in every turn; use more mounts" in told


@pytest.mark.sockets
def test_a_gyroscope_is_calibrated_about_three_edges(rig: Rig, folder: Path) -> None:
    document = run(rig, folder, RATES)
    found = document["results"]
    assert list(found)[-12:] == [
        *(f"gyro-g-sensitivity-{axis}{along}" for axis in "xyz" for along in "xyz"),
        *(f"rate-residual-{axis}" for axis in "xyz"),
    ]
    assert " turns and rests" in rig("runs").out
    for axis in "xyz":
        assert found[f"gyro-scale-{axis}"]["value"] == pytest.approx(6.04e-3, rel=0.01)
        assert found[f"gyro-scale-{axis}"]["unit"] == "V/(deg/s)"
        assert found[f"rate-residual-{axis}"]["value"] < 0.03
    lean = {pair: found[f"gyro-misalignment-{pair}"] for pair in ("xy", "yx", "xz", "zx", "yz", "zy")}
    expected = {"xy": -0.4, "yx": 0.4, "xz": -0.9, "zx": 0.9, "yz": -0.6, "zy": 0.6}
    assert {pair: each["value"] for pair, each in lean.items()} == pytest.approx(expected, abs=0.05)
    assert abs(found["gyro-g-sensitivity-yz"]["value"]) > 20 * found["gyro-g-sensitivity-yz"]["std"]


@pytest.mark.sockets
def test_a_gyroscope_that_was_turned_about_one_edge_has_one_scale_factor(rig: Rig, folder: Path) -> None:
    document = run(rig, folder, (*RATES, *ONE))
    scales = {name for name in document["results"] if name.startswith("gyro-scale")}
    assert scales == {"gyro-scale-z"}
    assert "gyro-bias-x" in document["results"]


@pytest.mark.sockets
def test_the_table_of_a_run_is_a_table_of_rates_that_a_file_gives_back(rig: Rig, folder: Path, tmp_path: Path) -> None:
    name = run(rig, folder, (*RATES, *ONE))["run"]
    with Record() as record:
        table = table_of(record, name)
        turns = [kept.pose for kept in record.kept(name)]
    assert (table.kind, table.unit, table.constants["latitude_deg"]) == ("rates", "V", 40.443)
    assert table.column("rate_deg_s").tolist() == [-pose.rate_deg_s + 0.0 for pose in turns]
    assert table.column("axis_z").tolist() == [1.0] * table.n
    assert table.column("az").tolist() == [np.cos(np.radians(pose.alpha_deg)) for pose in turns]
    assert "filter_corner_hz" not in table.constants
    assert {"gx_std", "n", "temperature_c", "t_s"} <= set(table.columns)
    out = tmp_path / "rates.csv"
    assert rig("export", name, "--out", str(out)).status == 0
    again = read_csv(out)
    assert {each: again.column(each).tolist() for each in table.columns} == {
        each: pytest.approx(table.column(each).tolist()) for each in table.columns
    }


@pytest.mark.sockets
def test_every_command_takes_runs_of_gyroscopes_and_magnetometers(
    rig: Rig, folder: Path, tmp_path: Path, undrawn: None
) -> None:
    field, rates = run(rig, folder, FIELD)["run"], run(rig, folder, (*RATES, *ONE))["run"]
    model, page = str(tmp_path / "hard.yaml"), tmp_path / "page.html"
    assert rig("diagnose", field, "--json").document["candidates"][0]["effect"] == "hard-iron"
    assert rig("add", "hard-iron", "--model", "field", "--data", field, "--out", model).status == 0
    assert rig("diagnose", field, "--model", model, "--json").document["candidates"][0]["effect"] == "soft-iron"
    assert "fails" in rig("compare", field, "--model", model, "--json").document
    assert rig("report", field, "--model", "magnetometer", "--out", str(page)).status == 0
    assert "<h2>General calibration</h2>" in page.read_text(encoding="utf-8")
    assert rig("diagnose", rates, "--json").document["verdict"] == "effect-missing"


@pytest.mark.sockets
def test_a_run_stopped_in_a_turn_halts_the_stage_and_resumes_with_the_same_samples(
    rig: Rig, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C comes while beta turns for the second time."""
    whole = run(rig, folder, (*RATES, *ONE))["run"]
    looks = iter(range(100))
    looked = RotaryStage._require_turning

    def interrupted(stage: RotaryStage, rate_deg_s: float) -> None:
        looked(stage, rate_deg_s)
        if next(looks) == 7:
            raise KeyboardInterrupt("SIGINT")

    with monkeypatch.context() as patched:
        patched.setattr(RotaryStage, "_require_turning", interrupted)
        stopped = rig("run", *RATES, *ONE, "--bench", str(folder / "quick.yaml"))
    assert stopped.status == 4
    name = stopped.document["run"]
    with Record() as record:
        assert (record.run(name).state, record.run(name).rows) == ("stopped", 3)
        assert not any(event.what == "not stopped" for event in record.events(name))
    assert rig("resume", name, "--unattended", "--json").status == 0
    with Record() as record:
        for a, b in zip(record.kept(whole), record.kept(name), strict=True):
            assert a.pose == b.pose
            np.testing.assert_array_equal(a.samples.volts, b.samples.volts)
        assert record.run(whole).results == record.run(name).results != {}


def test_a_plan_knows_ways_limits_and_mounts(rig: Rig) -> None:
    told = rig("plan", "rate-turn", "--rates-deg-s", "20,80").out
    assert "alpha 180, beta -180 to 180 deg: 4 poses  y turning  at 20, 80 deg/s in both directions" in told
    assert "mount-0-x-up: Does the sensor stand on edge, its x axis up and its y axis along the table's x?" in told
    assert "beta from -273.333 to 273.333 deg, within its limits -400 to 400 deg" in told
    refused = rig("plan", "rate-turn", "--rates-deg-s", "200")
    assert refused.status == 2
    assert "outside its limits -400 .. 400 deg; nothing was sent. Ask for a slower or shorter turn" in refused.err


def _stage(unit: int) -> dict[str, Any]:
    return {"driver": "oriental_az", "url": "simulated", "unit": unit}


def test_an_alarm_in_the_middle_of_a_turn_ends_the_run_and_the_turn(bench_file: Callable[..., Path]) -> None:
    """The first turn, at 20 deg/s, is under way from about 22 s to 40 s; the drive stops with alarm 30 at 30 s."""
    beta = _stage(2) | {"faults": [{"what": "alarm", "at_s": 30.0}]}
    adc = {
        "driver": "labjack_t7",
        "url": "simulated",
        "settings": {"channels": dict(zip(RATE, (0, 1, 2), strict=True))},
    }
    changes = {"instruments": {"alpha": _stage(1), "beta": beta, "adc": adc}, "d63": None, "limits": {}}
    bench = read_bench(bench_file(changes))
    procedure, looker = find("rate-turn"), Onlooker()
    chosen = parse(procedure, {"rates_deg_s": "20", "rest_s": "0.5", "mounts": "1"})
    with Record() as record:
        outcome = start(record, bench, procedure, chosen, looker)
        assert isinstance(outcome.error, StageAlarm)
        assert "alarm 30, overload" in str(outcome.error)
        assert (outcome.run.state, outcome.moving) == ("failed", ())
        assert [kept.pose.rate_deg_s for kept in record.kept(outcome.run.run)] == [0.0, 0.0]
        plan = (record.state(outcome.run.run) or {})["rig"]
    assert looker.said[-1].startswith("turning beta at 20 deg/s")
    assert plan["clock_s"] < 20.0  # the state is that of the last rest, from which the run goes on
