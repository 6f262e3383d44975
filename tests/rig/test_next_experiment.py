"""The next experiment is a command that the bench can carry out, and what it will tell is computed or not said."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibrations.design.experiment import ADDITIONS, MENU, Experiment, experiment_by_physics
from calibrations.documents import diagnosis_document
from calibrations.effects.catalogue import catalogue
from calibrations.loop import diagnose
from calibrations.model.file import read_model
from procedures.catalogue import find
from procedures.settings import parse
from rig.bench import Bench, read_bench
from rig.cli import rig as commands
from rig.cli.terminal.options import read_settings
from rig.planning.next_experiment import Dispute, choose_experiment, command_line, plan_experiment, with_next_experiment
from rig.planning.sweep_range import columns
from rig.record import Record
from rig.services.next_experiment import planned
from rig.services.request import Request
from tests.hidden.quick_rig import QuickRig
from tests.hidden.rigs import IDEAL
from tests.rig.conftest import Rig

PAIRS = (
    {"quadratic-nonlinearity", "bias"},
    {"output-filter", "sampling-delay"},
    {"temperature-bias", "temperature-hysteresis"},
    {"warm-up-bias", "bias-drift"},
    {"temperature-bias", "warm-up-bias"},
    {"base-tilt", "stage-zero-offset"},
    {"axis-misalignment", "stage-zero-offset"},
    {"dead-zone", "hysteresis"},
)
BY_PHYSICS = tuple(Experiment(*experiment_by_physics(names)[:2], (), "") for names in PAIRS)
COARSE = Experiment("sweep", {"step_deg": 45.0, "inclinations_deg": [90.0, 30.0, 150.0]}, (), "")


def named(e: Experiment) -> str:
    return " ".join([e.procedure, *map(str, e.settings.values())])


@pytest.mark.parametrize("experiment", [*MENU, *ADDITIONS, *BY_PHYSICS], ids=named)
def test_every_experiment_can_be_planned_and_its_command_line_means_the_same(experiment: Experiment) -> None:
    e, planned = plan_experiment(experiment, read_bench(None), Path("a bench.yaml"))
    name, run, procedure, *rest = shlex.split(e.command)
    assert (name, run, procedure, rest[-2:]) == ("rig", "run", e.procedure, ["--bench", "a bench.yaml"])
    found = find(procedure)
    assert parse(found, read_settings(rest[:-2], (), found.defaults)) == planned.settings
    assert e.duration_s == pytest.approx(planned.duration_s, abs=0.1)
    assert run in commands.list_commands(None)


@cache
def turned() -> Any:
    """The diagnosis of a sensor that is turned about z, as any stage may be."""
    config = IDEAL.changed({"sensor": {"package": {"turn_z_deg": 0.05}}})
    return diagnose(QuickRig(config, 8, read_bench(None)).measure(COARSE)[1], read_model("linear"))


def test_a_turned_sensor_is_to_be_mounted_face_down() -> None:
    e = with_next_experiment(turned(), catalogue(), read_bench(None), None).next_experiment
    assert e.procedure == "sweep"
    assert e.settings["face"] == "both"
    assert e.separates == (("stage-zero-offset", "axis-misalignment"),)
    assert e.expected.deviations > 50
    assert e.expected.probability > 0.999
    assert e.duration_s < 3352


def test_a_page_and_its_report_plan_an_experiment_once_for_each_bench(monkeypatch: pytest.MonkeyPatch) -> None:
    found = replace(turned(), findings=replace(turned().findings, steps=(), baseline=replace(turned().findings.end)))
    benches: list[str] = []

    def chosen(_: Dispute, by_physics: Experiment, bench: Bench, __: Path | None) -> Experiment:
        benches.append(bench.name)
        return by_physics

    monkeypatch.setattr("rig.planning.next_experiment.choose_experiment", chosen)
    for bench in (read_bench(None), read_bench(None), read_bench(None).model_copy(update={"name": "another"})):
        with_next_experiment(found, catalogue(), bench, None)
    assert benches == [read_bench(None).name, "another"]


def test_values_that_are_not_computed_are_null() -> None:
    bench = read_bench(None)
    _, table = QuickRig(IDEAL.changed({"base": {"tilt_y_deg": 0.05}}), 8, bench).measure(COARSE)
    found = with_next_experiment(diagnose(table, read_model("linear")), catalogue(), bench, Path("b.yaml"))
    e = diagnosis_document(found, "linear")["next_experiment"]
    assert (e["procedure"], e["settings"], e["expected"]) == ("level-check", {"on": "base"}, None)
    assert e["command"] == "rig run level-check --on base --bench b.yaml"
    assert "only the tilt of the base" in e["why"]


def dispute(temperature: bool) -> Dispute:
    found = turned()
    return replace(
        Dispute.of(found.findings.end, found.next_experiment.separates, catalogue()), of_temperature=temperature
    )


def test_the_temperature_of_a_room_is_not_predicted() -> None:
    """Of what depends on temperature only experiments in the oven are foreseen, and they tell these two nothing."""
    told = Experiment("temperature-cycle", {}, (("a", "b"),), "by physics")
    assert choose_experiment(dispute(temperature=True), told, read_bench(None)).expected is None
    assert choose_experiment(dispute(temperature=False), told, read_bench(None)).expected is not None


def test_an_experiment_that_needs_an_oven_is_proposed_with_a_remark_without_one(
    bench_file: Callable[..., Path],
) -> None:
    parts = {
        role: part.model_dump(mode="json") for role, part in read_bench(None).instruments.items() if role != "oven"
    }
    bench = read_bench(bench_file({"instruments": parts}))
    e = choose_experiment(dispute(temperature=True), Experiment("soak", {"oven_c": 45.0}, (), "it is held"), bench)
    assert e.duration_s is None
    assert "it is held; but not on this bench: the bench has no oven" in e.why


def test_limits_of_a_stage_rule_experiments_out(bench_file: Callable[..., Path]) -> None:
    parts = {role: part.model_dump(mode="json") for role, part in read_bench(None).instruments.items()}
    parts["alpha"]["settings"]["limits_deg"] = [-95, 95]
    bench = read_bench(bench_file({"instruments": parts}))
    told = Experiment("sweep", {"face": "both"}, (("a", "b"),), "by physics")
    assert "alpha: 150 deg is outside its limits" in choose_experiment(dispute(temperature=False), told, bench).why


def test_the_sensor_in_an_oven_warms_over_minutes() -> None:
    bench = read_bench(None)
    _, table = QuickRig(IDEAL, 1, bench).measure(COARSE)
    _, planned = plan_experiment(
        Experiment("temperature-cycle", {"temperatures_c": [35.0, 50.0], "soak_s": 3600.0}, (), ""), bench, None
    )
    foreseen: dict[str, Any] = dict(columns(planned, table))
    at_c = [foreseen["temperature_c"][k : k + 8].mean() for k in (0, 8, 16)]
    assert at_c == pytest.approx([34.5, 49.4, 35.6], abs=0.5)
    assert foreseen["t_s"][0] > table.time_s.max()
    assert np.all(np.diff(foreseen["t_s"]) > 0)
    assert set(foreseen["dwell_s"]) == {5.0}


def test_commands_print_the_next_experiment(rig: Rig, tmp_path: Path) -> None:
    from calibrations.importing.foreign import write_csv

    data = str(tmp_path / "turned.csv")
    write_csv(turned().fit.table, Path(data))
    for command in ("diagnose", "discover"):
        said = rig(command, data).out
        assert "    rig run sweep --face both --step-deg 45 --inclinations-deg 90,30,150\n    14:" in said
        assert "standard deviations, correct with a probability of 99.9 %, from its own data" in said


@pytest.mark.usefixtures("rig_home")
@pytest.mark.parametrize(
    ("bench", "told"), [({"name": "ours"}, True), ({"name": read_bench().name}, False), ({}, False)]
)
def test_another_bench_than_that_of_the_run_is_named(bench: dict[str, str], told: bool) -> None:
    heard: list[str] = []
    about: dict[str, Any] = {"identities": {}, "configuration": "", "constants": {}, "source": ""}
    with Record() as record:
        run = record.begin("sweep", {}, bench=bench, **about)
    assert planned(turned(), Request(run), catalogue(), heard.append).next_experiment.command.startswith(
        "rig run sweep"
    )
    assert (f'{run} was measured on the bench "ours", but the next' in " ".join(heard)) == told


def test_the_same_data_given_twice_is_refused(refused: Callable[..., str]) -> None:
    assert "good.csv is given twice; give the same data once" in refused("discover", "good.csv", "good.csv")


def test_a_command_line_is_made_of_words_that_a_shell_takes() -> None:
    e = Experiment("sweep", {"step_deg": 22.5, "inclinations_deg": [90.0, -30.0], "face": "both"}, (), "")
    assert command_line(e, None) == "rig run sweep --step-deg 22.5 --inclinations-deg 90,-30 --face both"
