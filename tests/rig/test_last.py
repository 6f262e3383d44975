"""A run is named by its id, by the beginning of it, or as the last one."""

from __future__ import annotations

from pathlib import Path

import pytest

import rig as application
from rig.errors import RecordError, UnknownRun
from rig.record import Record
from rig.record.measured import MeasuredRun
from tests.rig.conftest import Rig


def begun(record: Record, procedure: str) -> str:
    return record.begin(procedure, {}, bench={}, identities={}, configuration="", source="a test", constants={})


def test_the_last_run_and_the_last_of_a_procedure() -> None:
    with Record() as record:
        sweep, soak, other = begun(record, "sweep"), begun(record, "soak"), begun(record, "repeat")
        names = {"last": other, "last soak": soak, "last sweep": sweep, sweep: sweep, soak[:-2]: soak}
        assert {name: record.run(name).run for name in names} == names
        with pytest.raises(UnknownRun, match=r"Did you mean 'soak'\?"):
            record.run("last soaks")
        with pytest.raises(UnknownRun, match=r"3 runs in .* write more of the id"):
            record.run(sweep[:4])


def test_the_last_of_a_procedure_needs_no_quotes(rig: Rig) -> None:
    with Record() as record:
        sweep, _ = begun(record, "sweep"), begun(record, "soak")
    assert rig("show", "last", "sweep").out.startswith(sweep)
    assert rig("show", "last sweep").out.startswith(sweep)
    assert rig("show", "last", "sweeps").status == 2


def of_sensor(record: Record, procedure: str, name: str, serial: str = "") -> str:
    constants = {"sensor": name, "serial": serial}
    return record.begin(procedure, {}, bench={}, identities={}, configuration="", source="a test", constants=constants)


def test_a_sensor_names_its_only_run_and_last_names_the_newest_of_several() -> None:
    with Record() as record:
        only = of_sensor(record, "soak", "B2", "S-17")
        old, soak = of_sensor(record, "sweep", "A1"), of_sensor(record, "soak", "A1")
        names = {"B2": only, "S-17": only, "last A1": soak, "last sweep A1": old, "last soak B2": only}
        assert {name: record.run(name).run for name in names} == names
        with pytest.raises(
            UnknownRun, match=f"2 runs in .* of the sensor 'A1': {soak}, {old}; .* 'last A1' for the newest"
        ):
            record.run("A1")
        for odd in ("A", "last A", "last sweep B2", "sweep A1"):
            with pytest.raises(UnknownRun, match="no run"):
                record.run(odd)


def test_a_misspelt_sensor_is_suggested(golden) -> None:
    with Record() as record:
        of_sensor(record, "soak", "ADXL203", "simulated")
        with golden.refused(UnknownRun):
            record.run("simulat")


def test_the_name_of_a_sensor_of_a_batch_chooses_it_in_its_run() -> None:
    bench = {"sensors": {"a": {"name": "ADXL", "serial": "17"}, "b": {"name": "ADXL", "serial": "18"}}}
    with Record() as record:
        run = record.begin("sweep", {}, bench=bench, identities={}, configuration="", source="a test", constants={})
        chosen = {
            name: MeasuredRun.named(record, name).name for name in ("b", "18", "last b", "last sweep 17", f"{run}/a")
        }
        assert list(chosen.values()) == [f"{run}/b", f"{run}/b", f"{run}/b", f"{run}/a", f"{run}/a"]
        for both in (run[:-1], "ADXL"):
            with pytest.raises(RecordError, match="choose one"):
                MeasuredRun.named(record, both)


def test_an_empty_record_has_no_last_run(golden) -> None:
    with Record() as record, golden.refused(UnknownRun):
        record.run("last")


@pytest.mark.parametrize(
    "command",
    [
        ("show",),
        ("compare",),
        ("fit", "--force", "--out", "fitted.yaml"),
        ("noise",),
        ("diagnose",),
        ("export", "--force", "--out", "out.csv"),
    ],
    ids=lambda command: command[0],
)
def test_commands_take_the_last_run(rig: Rig, work: Path, command: tuple[str, ...]) -> None:
    run = rig("import", "good.csv", "--kind", "poses", "--json").document["run"]
    named, last = (rig(*command, data, "--json") for data in (run, "last"))
    assert named.status == last.status
    assert last.out.replace('"last"', f'"{run}"') == named.out
    assert (work / "good.csv").exists()


def test_python_loads_the_last_run(rig: Rig, work: Path) -> None:
    rig("import", "good.csv", "--kind", "poses")
    assert application.load("last").digest == application.load("good.csv").digest
