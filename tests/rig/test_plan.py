"""A plan says what a run would do, and touches nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from drivers.errors import LimitError
from procedures.catalogue import find
from procedures.errors import ProcedureError
from procedures.settings import parse
from rig.bench import Bench, read_bench
from rig.planning.plan import plan
from rig.record import Record
from rig.runs.runner import start
from tests.recorded import command
from tests.rig.conftest import Rig
from tests.rig.rigging import Onlooker, small_sweep


def test_a_sweep_is_518_poses_within_the_limits() -> None:
    sweep = find("sweep")
    planned = plan(read_bench(), sweep, parse(sweep, {}))
    assert planned.poses == 518
    assert planned.reach["alpha"] == ((0, 150), (-400, 400))
    assert planned.reach["beta"] == ((-5, 365), (-400, 400))
    assert 518 * 5.5 < planned.duration_s < 2 * 518 * 5.5
    assert planned.questions[0].startswith("mounting: ")


def test_every_move_is_listed_once_and_in_time() -> None:
    planned = plan(read_bench(), *small_sweep())
    ends = [step.start_s + step.duration_s for step in planned.steps]
    assert [step.start_s for step in planned.steps[1:]] == ends[:-1]
    assert planned.duration_s == ends[-1]
    moves = [step.what for step in planned.steps if step.what.startswith("beta from")]
    assert moves[:3] == [
        "beta from 0 to 180 deg",
        "beta from 180 to -5 deg",
        "beta from -5 to 0 deg",
    ]  # level check first


@pytest.mark.sockets
def test_duration_and_room_are_those_of_the_run() -> None:
    planned = plan(read_bench(), *small_sweep())
    with Record() as record:
        run = start(record, read_bench(), *small_sweep(), Onlooker()).run.run
        state: Any = record.state(run)
        with record.engine.connect() as at:
            stored = at.exec_driver_sql("SELECT sum(length(samples)) FROM blocks").scalar()
    assert state["rig"]["clock_s"] == pytest.approx(planned.duration_s, rel=0.05)
    assert stored < planned.bytes < 3 * stored


def test_a_plan_connects_to_nothing(rig_home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object) -> None:
        raise AssertionError("a plan connected to something")

    monkeypatch.setattr("socket.socket.connect", refuse)
    plan(read_bench(), *small_sweep())
    assert not rig_home.exists()


def test_a_move_beyond_its_limits_is_refused_as_the_stage_would(golden) -> None:
    document = read_bench().document()
    document["instruments"]["alpha"]["settings"]["limits_deg"] = [-10, 80]
    with golden.refused(LimitError):
        plan(Bench.model_validate(document), *small_sweep())


def test_an_instrument_that_the_bench_lacks_is_named(golden) -> None:
    document = read_bench().document()
    del document["instruments"]["adc"]
    with golden.refused(ProcedureError):
        plan(Bench.model_validate(document), *small_sweep())


def test_a_plan_includes_the_oven(tmp_path: Path) -> None:
    (tmp_path / "bake.py").write_text(
        '"""bake: warm."""\n\ndef bake(rig, *, to_c: float = 40.0):\n'
        "    rig.oven.set_temperature(to_c)\n    rig.oven.run(True)\n    rig.wait(60)\n    rig.oven.temperature_c()\n"
    )
    bake = find("bake", tmp_path)
    whats = [step.what for step in plan(read_bench(), bake, {"to_c": 40.0}).steps]
    assert whats[-3:] == ["oven to 40 C", "oven on", "wait 60 s"]
    with pytest.raises(LimitError, match=r"oven: 90 C is outside its limits 0 \.\. 85 C"):
        plan(read_bench(), bake, {"to_c": 90.0})


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("sweep", "--step-deg", "0.0001"), "50400014 poses; the limit is 50000; give a larger step_deg, or fewer"),
        (("sweep", "--step-deg", "1e-300"), "at least 1000000000000000 poses; the limit is 50000; give a larger"),
        (("sweep", "--step-deg", "1e-320"), "at least 1000000000000000 poses"),
        (("sweep", "--step-deg", "0.2", "--face", "both"), "50428 poses"),
        (("noise-floor", "--duration-s", "1e9", "--block-s", "1"), "1000000000 poses"),
        (("noise-floor", "--duration-s", "1e308", "--block-s", "1e-300"), "at least 1000000000000000 poses"),
        (("motion", "--still-s", "1e9", "--block-s", "1"), "1000000000 poses; the limit is 50000; give a larger step"),
        (("soak", "--duration-s", "1e9"), "100000000 poses"),
        (("soak", "--block-s", "1e-9"), "43200000000000 poses"),
        (("soak", "--duration-s", "49000", "--interval-s", "1", "--block-s", "1"), "at least 200000 poses"),
        (("temperature-cycle", "--soak-s", "1e300"), "more than"),
        (("repeat", "--times", "1000000000"), "at least 200000 poses; the limit is 50000; give a larger step"),
        (("temperature-cycle", "--cycles", "1000000000"), "at least 200000 poses"),
        (("magnetometer-turn", "--step-deg", "1e-320"), "at least 1000000000000000 poses"),
        (("misalignment", "--most-rounds", "4000"), "64000 poses; the limit is 50000; give a smaller most_rounds"),
    ],
)
def test_a_plan_without_bound_is_refused_before_it_is_built(rig: Rig, words: tuple[str, ...], said: str) -> None:
    ended = rig("plan", *words)
    assert (ended.status, f"the plan has {said}" in ended.err) == (2, True), ended.err


@pytest.mark.parametrize("name", ["sweep", "misalignment", "repeat"])
def test_a_dwell_that_no_memory_holds_is_refused(rig: Rig, name: str) -> None:
    ended = rig("plan", name, "--dwell-s", "1e7")
    assert (ended.status, "give a shorter dwell_s" in ended.err) == (2, True), ended.err


def test_the_help_of_a_procedure_shows_its_settings_with_units_and_meaning() -> None:
    status, out, _ = command("run", "sweep", "--help")
    assert status == 0
    assert "--step-deg  (default: 10 deg)\n" in out
    assert "up, down, both" in out
    assert command("procedures", "soak")[1].startswith("soak: ")
    assert "PROCEDURE" in command("run", "--help")[1]
