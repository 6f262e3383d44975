"""`rig run hand-positions` on the simulated hand: the run, its results, the analysis, and what a person sees."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import yaml
from rich.console import Console

from calibrations.geometry.turns import make_turns
from drivers.handheld.hand import Hand
from drivers.handheld.world import INPUTS, HandheldWorld
from drivers.imu_lines.driver import Settings
from procedures.catalogue import find
from procedures.session import Guidance
from procedures.settings import parse
from rig.bench import read_bench
from rig.bench.file import HAND
from rig.cli.terminal.guide import Guide
from rig.drawings import orientation_drawing, orientation_map
from rig.errors import BenchError
from rig.instruments.wiring import world_of
from rig.planning.plan import plan
from rig.planning.preparation import checks
from rig.record import Record
from rig.record.measured import MeasuredRun, table_of
from rig.results.by_hand import TARGET_PERCENT, _uncertainty
from rig.results.result import Missing, Result
from rig.runs.background import status
from rig.runs.runner import resume, start
from rig.web.pages.run_begin import before_resume, before_start
from tests.handling import FIELD_UT, true_ellipsoid, true_gyroscope
from tests.rig.conftest import Rig
from tests.rig.rigging import Onlooker

RUN = ("run", "hand-positions", "--bench", str(HAND), "--unattended", "--json")
UP = (0.0, 0.0, 1.0)


@pytest.fixture
def bench_with(tmp_path: Path) -> Callable[..., Path]:
    """The bench of the hand with other keys of its world."""

    def write(**world: Any) -> Path:
        document = yaml.safe_load(HAND.read_text(encoding="utf-8"))
        document["world"] |= world
        path = tmp_path / "hand.yaml"
        path.write_text(yaml.safe_dump(document), encoding="utf-8")
        return path

    return write


@pytest.mark.slow
@pytest.mark.sockets
def test_a_run_finds_zeros_gains_and_angles(rig: Rig, rig_home: Path) -> None:
    ended = rig(*RUN)
    found = ended.done().document["results"]
    world = world_of(read_bench(HAND))
    assert isinstance(world, HandheldWorld)
    for axis in "xyz":
        mass = getattr(world.triad, axis)
        for name, true in ((f"bias-{axis}", mass.zero_v), (f"scale-{axis}", mass.volts_per_g)):
            assert abs(found[name]["value"] - true) < 4 * found[name]["std"] + 3e-5  # the gains go with the cosines
    assert found["uncertainty"]["value"] < 1e-3
    assert rig("compare", "last", "--model", "linear", "--json").status == 0
    verdict = rig("diagnose", "last", "--json").document
    assert verdict["verdict"] in ("effect-missing", "ambiguous")  # common-scale has one gain for all axes


FIELDS_RUN = ("run", "hand-fields", "--bench", str(HAND), "--unattended", "--json")


@pytest.mark.slow
@pytest.mark.sockets
def test_a_run_finds_hard_and_soft_iron(rig: Rig, rig_home: Path) -> None:
    ended = rig(*FIELDS_RUN)
    found = ended.done().document["results"]
    world = world_of(read_bench(HAND))
    assert isinstance(world, HandheldWorld)
    hard_iron, gains = true_ellipsoid(world)
    strength = np.trace(gains) / 3 * world.config.laboratory.field_ut / FIELD_UT
    assert [found[f"hard-iron-{axis}"]["value"] for axis in "xyz"] == pytest.approx(hard_iron, abs=2e-3 * strength)
    assert found["field-total"]["value"] == pytest.approx(strength, rel=2e-3)
    assert found["uncertainty"]["value"] < 0.2
    verdict = rig("diagnose", "last", "--json").document
    assert {"hard-iron"} <= {candidate["effect"] for candidate in verdict["candidates"]}
    searched = rig("discover", "last", "--json").document
    assert searched["causes"] == ["hard-iron", "soft-iron"]


@pytest.mark.slow
@pytest.mark.sockets
def test_a_disturbed_field_is_a_result_that_is_missing(
    rig: Rig, rig_home: Path, bench_with: Callable[..., Path]
) -> None:
    magnet = {"x_mm": 0.0, "z_mm": -80.0, "moment_z_ma_m2": 40.0}
    bench = bench_with(laboratory={"magnet": magnet})
    ended = rig("run", "hand-fields", "--bench", str(bench), "--unattended", "--json", "--most-positions", "14")
    assert ended.status == 1
    assert "the magnitude of the field differs by" in ended.err
    assert "rig exclude" in ended.err
    assert ended.document["results"].keys() >= {"hard-iron-x", "left-by-ellipsoid"}
    assert rig("diagnose", "last", "--json").status == 0  # nothing is lost


TURNS_RUN = ("run", "hand-turns", "--bench", str(HAND), "--unattended", "--json")


@pytest.mark.slow
@pytest.mark.sockets
def test_a_run_finds_the_scale_factors_and_the_misalignment_of_a_gyroscope(
    rig: Rig, rig_home: Path, tmp_path: Path
) -> None:
    ended = rig(*TURNS_RUN)
    found = ended.done().document["results"]
    world = world_of(read_bench(HAND))
    assert isinstance(world, HandheldWorld)
    true = true_gyroscope(world)
    for k, axis in enumerate("xyz"):
        assert found[f"gyro-scale-{axis}"]["value"] == pytest.approx(true.gains[k], rel=2e-3)
        assert found[f"gyro-bias-{axis}"]["value"] == pytest.approx(true.b[k], abs=1e-4)
    assert found["uncertainty"]["value"] < 0.2
    verdict = rig("diagnose", "last", "--json").document
    assert verdict["candidates"][0]["effect"] == "gyro-misalignment"
    searched = rig("discover", "last", "--json").document
    assert (searched["verdict"], searched["causes"]) == ("adequate", ["gyro-misalignment"])
    exported = tmp_path / "turns.csv"
    assert rig("export", "last", "--format", "csv", "--out", str(exported)).status == 0
    again = rig("fit", str(exported), "--model", "gyroscope", "--json").document
    fitted = rig("fit", "last", "--model", "gyroscope", "--json").document
    values = [[p["value"] for p in document["parameters"]] for document in (again, fitted)]
    assert values[0] == pytest.approx(values[1], rel=1e-6)
    assert rig("report", "last", "--model", "gyroscope", "--out", str(tmp_path / "report.html")).status == 0


@pytest.mark.slow
@pytest.mark.sockets
def test_interrupted_turns_continue(rig_home: Path) -> None:
    procedure, bench = find("hand-turns"), read_bench(HAND)

    class Interrupting(Onlooker):
        def kept(self, kept: Any) -> None:
            super().kept(kept)
            if len(self.seen) == 8:
                raise KeyboardInterrupt

    with Record() as record:
        stopped = start(record, bench, procedure, parse(procedure, {}), Interrupting())
        assert (stopped.run.state, stopped.run.rows) == ("stopped", 8)
        ended = resume(record, stopped.run.run, Onlooker())
        assert ended.run.state == "complete"
        kept = list(record.kept(ended.run.run))
        turns = make_turns(table_of(record, ended.run.run))
    assert kept[7].pose.path.startswith("turn to ")
    assert turns.numbers is not None
    assert 7 not in turns.numbers  # its rest did not come
    assert turns.n >= 10


def test_a_bench_without_the_sensor_is_refused(rig: Rig, rig_home: Path, tmp_path: Path) -> None:
    document = yaml.safe_load(HAND.read_text(encoding="utf-8"))
    document["instruments"]["adc"]["settings"]["on_request"] = {}
    path = tmp_path / "accelerometer.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    for procedure, missing in (("hand-fields", "mx, my, mz"), ("hand-turns", "gx, gy, gz")):
        ended = rig("run", procedure, "--bench", str(path), "--unattended")
        assert ended.status != 0
        assert f"adc: no input is wired to {missing}; there are ax, ay, az" in ended.err


def test_a_gyroscope_without_an_accelerometer_gets_the_advice_of_whole_turns(
    rig: Rig, rig_home: Path, tmp_path: Path
) -> None:
    document = yaml.safe_load(HAND.read_text(encoding="utf-8"))
    settings = document["instruments"]["adc"]["settings"]
    inputs = {**settings["channels"], **settings["on_request"]}
    settings["on_request"] = {}
    settings["channels"] = {name: inputs[name] for name in ("gx", "gy", "gz")}
    path = tmp_path / "gyroscope.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    ended = rig("run", "hand-turns", "--bench", str(path), "--unattended")
    assert ended.status != 0
    assert "adc: no input is wired to ax, ay, az; there are gx, gy, gz" in ended.err
    assert "log whole turns on the table" in ended.err
    assert "rig import LOG --kind rates --constant turn_deg=360" in ended.err


@pytest.mark.slow
@pytest.mark.sockets
def test_a_stopped_run_continues_with_its_positions(rig_home: Path) -> None:
    procedure, bench = find("hand-positions"), read_bench(HAND)

    class Interrupting(Onlooker):
        def kept(self, kept: Any) -> None:
            super().kept(kept)
            if len(self.seen) == 5:
                raise KeyboardInterrupt

    with Record() as record:
        stopped = start(record, bench, procedure, parse(procedure, {}), Interrupting())
        assert (stopped.run.state, stopped.run.rows) == ("stopped", 5)
        ended = resume(record, stopped.run.run, looking := Onlooker())
        assert (ended.run.state, len(looking.seen)) == ("complete", ended.run.rows - 5)
        table = table_of(record, ended.run.run)
    assert table.output_names == ("ax", "ay", "az")
    assert {"t_s", "temperature_c", "n"} <= set(table.columns)
    assert np.all(np.diff(table.time_s) > 0)


@pytest.mark.slow
@pytest.mark.sockets
def test_an_accuracy_that_was_not_reached_is_a_result_that_is_missing(rig: Rig, rig_home: Path) -> None:
    ended = rig(*RUN, "--target-g", "1e-6", "--most-positions", "12")
    assert ended.status == 1
    assert "mg, target 0.001 mg; take more positions, or longer rests" in ended.err
    assert "uncertainty" not in ended.document["results"]


@pytest.mark.parametrize(("percent", "is_reached"), [(0.19, True), (0.201, True), (0.23, True), (0.25, False)])
def test_a_target_that_is_reached_within_the_error_of_an_uncertainty_is_reached(
    percent: float, is_reached: bool
) -> None:
    measured = cast(MeasuredRun, SimpleNamespace(run=SimpleNamespace(settings={"target_percent": 0.2})))
    reached = f"gyro-scale-factor.x: standard uncertainty {percent:g} %"
    found = _uncertainty(measured, percent, reached, "turns", TARGET_PERCENT)["uncertainty"]
    assert found == (
        Result(percent, "%") if is_reached else Missing(f"{reached}, target 0.2 %; take more turns, or longer rests")
    )


def test_a_bench_without_the_inputs_is_refused(rig: Rig, rig_home: Path) -> None:
    ended = rig("run", "hand-positions", "--unattended")
    assert ended.status != 0
    assert "no input is wired to ax, ay, az" in ended.err


def test_the_bench_file_is_an_example(rig: Rig) -> None:
    assert rig("check", "--example-hand").out == HAND.read_text(encoding="utf-8")


DIGITAL = {  # settings of each digital sensor, the unit of its accelerometer, and 1 g in it
    "imu_lines": ({"columns": {"time": 1, "ax": 2, "ay": 3, "az": 4}, "unit": "g"}, "g", 1.0),
    "mavlink_imu": ({"outputs": ["ax", "ay", "az"]}, "m/s^2", 9.80665),
    "xsens_mti": ({"outputs": ["ax", "ay", "az"]}, "m/s^2", 9.80665),
}


@pytest.mark.slow
@pytest.mark.sockets
@pytest.mark.parametrize("driver", list(DIGITAL))
def test_a_digital_sensor_is_calibrated_in_its_own_unit(rig: Rig, rig_home: Path, tmp_path: Path, driver: str) -> None:
    settings, unit, one_g = DIGITAL[driver]
    document = yaml.safe_load(HAND.read_text(encoding="utf-8"))
    adc = {"driver": driver, "url": "simulated", "settings": settings | {"rate_hz": 100}}
    document["instruments"]["adc"] = adc
    digital_bench = tmp_path / "digital.yaml"
    digital_bench.write_text(yaml.safe_dump(document), encoding="utf-8")
    ended = rig("run", "hand-positions", "--bench", str(digital_bench), "--unattended", "--json")
    found = ended.done().document["results"]
    world = world_of(read_bench(digital_bench))
    assert isinstance(world, HandheldWorld)
    for axis in "xyz":
        mass, bias, scale = getattr(world.triad, axis), found[f"bias-{axis}"], found[f"scale-{axis}"]
        assert (bias["unit"], scale["unit"]) == (unit, f"{unit}/g")
        assert abs(bias["value"] - one_g * (mass.zero_v - 1.65) / 0.8) < 4 * bias["std"] + 4e-5 * one_g
        assert abs(scale["value"] - one_g * mass.volts_per_g / 0.8) < 4 * scale["std"] + 4e-5 * one_g
    fitted = rig("fit", "last", "--model", "linear")
    assert fitted.status == 0
    assert f" {unit}/g" in fitted.out
    assert " V" not in fitted.out


NINE = {"columns": {name: k + 1 for k, name in enumerate(("time", *INPUTS))}, "unit": "g", "rate_hz": 100}


@pytest.mark.slow
@pytest.mark.sockets
@pytest.mark.parametrize(("procedure", "found_name", "unit"), [
    ("hand-fields", "hard-iron-x", "uT"),
    ("hand-turns", "gyro-bias-x", "deg/s"),
])  # fmt: skip
def test_a_digital_unit_is_calibrated_in_its_own_units(
    rig: Rig, rig_home: Path, tmp_path: Path, procedure: str, found_name: str, unit: str
) -> None:
    document = yaml.safe_load(HAND.read_text(encoding="utf-8"))
    document["instruments"]["adc"] = {"driver": "imu_lines", "url": "simulated", "settings": NINE}
    path = tmp_path / "digital.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    ended = rig("run", procedure, "--bench", str(path), "--unattended", "--json")
    assert ended.done().document["results"][found_name]["unit"] == unit


def test_a_digital_sensor_records_the_outputs_of_two_sensors_on_request() -> None:
    settings = Settings(columns={name: k + 1 for k, name in enumerate(INPUTS)})
    assert list(settings.channels) == ["ax", "ay", "az"]
    assert list(settings.only("adc", INPUTS[:6]).channels) == list(INPUTS[:6])
    assert list(settings.only("adc", INPUTS[6:]).channels) == list(INPUTS[6:])


def test_a_hand_is_set_in_the_bench_file(bench_with: Callable[..., Path]) -> None:
    world = world_of(read_bench(bench_with(hand={"slips": 1.0})))
    assert isinstance(world, HandheldWorld)
    assert world.script._hand == Hand(slips=1.0)
    with pytest.raises(BenchError, match=r"hand\.slip.*Did you mean"):
        read_bench(bench_with(hand={"slipz": 1.0}))


def test_a_position_is_marked_by_a_sound_and_a_tick() -> None:
    console = Console(file=io.StringIO(), width=100, force_terminal=True, color_system=None)
    guide = Guide(find("hand-positions"), read_bench(HAND), {}, console)
    guide.guide(Guidance("position 1: +z side up, then let go", UP))
    assert "\a" not in console.file.getvalue()  # type: ignore[attr-defined]
    guide.guide(Guidance("position 2: +x side up, then let go", (1.0, 0.0, 0.0), (UP,)))
    shown = console.file.getvalue()  # type: ignore[attr-defined]
    assert shown.count("\a") == 1
    assert "✓ position 1 taken" in shown
    assert "position 2: +x side up, then let go" in shown


def test_the_map_shows_taken_lacking_and_next() -> None:
    lines = orientation_map(Guidance("", (1.0, 0.0, 0.0), (UP, (0.0, -1.0, 0.0))))
    assert lines[-1].startswith("● covered (2 of 26 directions)")
    assert lines[2].count("●") == 1
    assert lines[2].count("◎") == 1
    assert lines[3].count("●") == 1
    assert sum(line.count("·") for line in lines[1:4]) == 23
    ended = orientation_map(Guidance("", (1.0, 0.0, 0.0), (UP,), moves=False))
    assert not any("◎" in line for line in ended[:-1])


def test_the_map_of_a_magnetometer_shows_the_field() -> None:
    wanted = tuple(np.array([1.0, 0.0, -1.0]) / np.sqrt(2))
    guidance = Guidance("", (0.0, 0.0, 1.0), ((0.0, 0.0, -1.0),), north=(1.0, 0.0, 0.0), wanted=wanted)
    lines = orientation_map(guidance)
    assert "-z with field" in lines[0]
    assert [line.count("◎") for line in lines[1:4]] == [0, 1, 0]
    drawn = orientation_drawing(guidance)
    assert ">north</text>" in drawn
    assert ">up</text>" in drawn
    assert ">north</text>" not in orientation_drawing(replace(guidance, north=(), wanted=()))


def test_the_drawing_shows_the_next_orientation_and_both_halves() -> None:
    guidance = Guidance("position 3: +x side up", (1.0, 0.0, 0.0), (UP, (0.0, -1.0, 0.0)))
    drawn = orientation_drawing(guidance)
    assert "position 3: +x side up" in drawn
    assert "covered (2 of 26 directions)" in drawn
    assert drawn.count("<circle") == 2 + 2 * 17 + 2  # discs, 26 orientations of which both show 8, the next one twice
    height = {name: float(y) for y, name in re.findall(r'y="([\d.]+)"[^>]*font-size="15.*?>(..)</text>', drawn)}
    assert len(height) == 3
    assert height["+x"] == min(height.values())  # the page counts downward
    corner = orientation_drawing(replace(guidance, text="position 4: corner -x +y -z up, then let go"))
    assert corner.count("corner −x +y −z up") == 2  # the title and the sentence
    ended = orientation_drawing(Guidance("12 positions taken", (1.0, 0.0, 0.0), (UP,), moves=False))
    assert "<polygon" not in ended


def test_the_status_of_a_run_by_hand_has_the_guidance_and_no_stage(rig_home: Path) -> None:
    planned = plan(read_bench(HAND), find("hand-positions"), parse(find("hand-positions"), {}))
    writer = status.StatusWriter("20261121-093012-000000-ab12", "hand-positions", read_bench(HAND))
    writer.planned(planned)
    status.folder().mkdir(parents=True)
    writer.guide(Guidance("position 2: +x side up", (1.0, 0.0, 0.0), (UP,)))
    writer.publish()
    shown = json.loads(status.file("20261121-093012-000000-ab12", "json").read_text("utf-8"))
    assert shown["attitude"] == {}
    guidance = Guidance(**shown["guidance"])
    assert (guidance.text, len(guidance.taken), guidance.moves) == ("position 2: +x side up", 1, True)
    assert orientation_drawing(guidance) == orientation_drawing(Guidance(guidance.text, (1.0, 0.0, 0.0), (UP,)))
    with Record() as record:
        run = record.run(
            record.begin("hand-positions", {}, bench={}, identities={}, configuration="", source="a test", constants={})
        )
    prepared = (before_start(planned, read_bench(HAND)), before_resume(run, planned, read_bench(HAND), None))
    assert all(each.attitude is None for each in prepared)
    assert [sum("upside down" in line for line in each.checks) for each in prepared] == [1, 1]


def test_without_stages_the_checks_are_those_of_a_hand() -> None:
    procedure = find("hand-positions")
    planned = plan(read_bench(HAND), procedure, parse(procedure, {}))
    assert planned.poses >= 12
    assert 60 < planned.duration_s < 300
    assert any("upside down" in question.text for question in planned.asked)
    assert not any("upside down" in line for line in checks(planned))  # asked once
    assert any("upside down" in line for line in checks(planned, is_resumed=True))
    assert not any("stages" in line for line in checks(planned, is_resumed=True))
