"""Temperature cycle, repetitions and the reference pose through the whole program; the oven is off where a run ends."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from procedures.catalogue import find
from procedures.settings import parse
from rig.bench import DEFAULT, Bench
from rig.bench.result_names import names_with_limits
from rig.instruments.instruments import connect_all
from rig.planning.plan import plan
from rig.record import Record
from tests.rig.conftest import Rig

FAST = ("--dwell-s", "0.2", "--unattended", "--json")


def bench(changes: dict[str, Any]) -> dict[str, Any]:
    """The document of the simulated rig, with changes one level down."""
    document: dict[str, Any] = yaml.safe_load(DEFAULT.read_text())
    for part, change in changes.items():
        document[part] |= change
    return document


def by_hand() -> dict[str, Any]:
    """The document of a bench whose converter does not switch the sensor's power."""
    document = bench({})
    del document["instruments"]["adc"]["settings"]["power_dio"]
    return document


@pytest.mark.sockets
def test_a_temperature_cycle_gives_coefficients_and_leaves_the_oven_off(rig: Rig) -> None:
    ended = rig("run", "temperature-cycle", "--temperatures-c", "40,55", "--soak-s", "3600", *FAST)
    document = ended.document
    found = document["results"]
    assert (ended.status, document["state"]) == (0, "complete")
    assert set(found) == {
        f"{q}-temperature{h}-{a}" for q in ("bias", "scale") for h in ("", "-hysteresis") for a in "xy"
    }
    slope = found["bias-temperature-x"]
    assert set(found) <= set(names_with_limits())
    assert (slope["unit"], slope["value"]) == ("V/K", pytest.approx(4e-3 / 8.2, rel=0.4))
    with Record() as record:
        state: Any = record.state(document["run"])
    assert states(state, "set_point_c") == [40.0]


def states(state: Any, key: str) -> list[Any]:
    """Every value of `key` in a nested document."""
    if isinstance(state, dict):
        own = [state[key]] if key in state else []
        return own + [value for part in state.values() for value in states(part, key)]
    return [value for part in state for value in states(part, key)] if isinstance(state, list) else []


@pytest.mark.sockets
def test_the_stop_of_a_run_switches_the_oven_off() -> None:
    with connect_all(Bench.model_validate(bench({}))) as rig:
        oven: Any = rig.drivers["oven"]
        oven.set_temperature(60.0)
        oven.run(True)
        assert oven.running()
        assert rig.stop() == []
        assert not oven.running()


@pytest.mark.sockets
def test_an_overheated_sensor_stops_the_run(rig: Rig, tmp_path: Path) -> None:
    path = tmp_path / "bench.yaml"
    path.write_text(yaml.safe_dump(bench({"limits": {"temperature_c": [-20, 45]}})))
    ended = rig("run", "temperature-cycle", "--temperatures-c", "40,60", "--bench", str(path), *FAST)
    assert (ended.status, ended.document["state"]) == (4, "stopped")
    assert "outside the limits of -20 to 45 C" in ended.err


@pytest.mark.sockets
def test_repetitions_of_every_kind_are_in_the_budget(rig: Rig) -> None:
    ended = rig("run", "repeat", "--times", "3", "--warm-s", "20", *FAST)
    found = ended.document["results"]
    assert ended.status == 0
    assert set(found) == {f"{q}-{k}-{a}" for q in ("bias", "scale") for k in ("as-is", "power", "mount") for a in "xy"}
    assert all(0 <= found[f"bias-{kind}-x"]["value"] < 0.01 for kind in ("as-is", "power", "mount"))
    assert all(each["std"] > 0 for each in found.values())
    assert set(found) <= set(names_with_limits())


@pytest.mark.sockets
@pytest.mark.slow
def test_manual_work_is_in_the_uncertainty_budget(rig: Rig, tmp_path: Path) -> None:
    document = by_hand()
    document["world"] = {"preset": "ideal", "noise": {"white_v": 1e-5}, "seating": {"tilt_deg": 0.02, "grip_pm": 20.0}}
    path = tmp_path / "bench.yaml"
    path.write_text(yaml.safe_dump(document))
    ended = rig("run", "repeat", "--times", "6", "--off-s", "30", "--warm-s", "5", "--bench", str(path), *FAST)
    ended = ended.document
    found, moved_v = ended["results"], 0.020 / 8.2  # 20 pm of the 8.2 nm that 1 g displaces
    as_is = found.get("bias-as-is-x", {"value": 0.0})  # not determined where the converter shows no noise
    assert as_is["value"] < 1e-5
    assert 0.4 * moved_v < found["bias-mount-x"]["value"] < 1.7 * moved_v  # of six mountings
    with Record() as record:
        state: Any = record.state(ended["run"])
        asked = [event.what for event in record.events(ended["run"]) if event.what.startswith("answer ")]
    assert state["rig"]["world"]["world"]["powered_ns"] > 30e9
    assert [what for what in asked if "-3" in what] == ["answer power-cycle-3", "answer remount-3"]


def test_a_plan_says_who_switches_the_power() -> None:
    repeat = find("repeat")
    settings = parse(repeat, {"times": "2", "mount": "false"})
    asking = plan(Bench.model_validate(by_hand()), repeat, settings)
    by_line = plan(Bench.model_validate(bench({})), repeat, settings)
    assert any(question.startswith("power-cycle-1: ") for question in asking.questions)
    assert len(by_line.questions) == 1
    assert [s.what for s in by_line.steps].count("adc switches the sensor off") == 2


@pytest.mark.sockets
def test_the_reference_pose_shows_drift(rig: Rig, tmp_path: Path) -> None:
    document = bench({})
    document["world"] = {"preset": "ideal", "noise": {"white_v": 1e-5}, "supply": {"drift_v_per_h": 0.1}}
    path = tmp_path / "bench.yaml"
    path.write_text(yaml.safe_dump(document))
    arguments = ("--inclinations-deg", "90", "--step-deg", "45", "--reference-every", "4", "--bench", str(path))
    ended = rig("run", "sweep", *arguments, *FAST)
    document = ended.document
    drift = document["results"]["reference-drift-x"]
    assert set(document["results"]) <= set(names_with_limits())
    expected = 0.1 * (2.5 + 0.7) / 5
    assert drift["unit"] == "V/h"
    assert drift["value"] == pytest.approx(expected, rel=0.1)
    assert document["poses"] == 18 + 6
    assert rig("run", "sweep", "--inclinations-deg", "90", "--step-deg", "180", *FAST).out.find("reference") == -1
