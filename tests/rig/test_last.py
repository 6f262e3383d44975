"""A run is named by its id, by the beginning of it, or as the last one."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

import rig as application
from rig.errors import UnknownRun
from rig.record import Record
from tests.rig.conftest import Ended


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


def test_an_empty_record_has_no_last_run() -> None:
    with Record() as record, pytest.raises(UnknownRun, match="no run 'last'"):
        record.run("last")


@pytest.mark.parametrize(
    "command",
    [
        ("show",),
        ("compare",),
        ("fit", "--out", "fitted.yaml"),
        ("noise",),
        ("diagnose",),
        ("export", "--out", "out.csv"),
    ],
    ids=lambda command: command[0],
)
def test_commands_take_the_last_run(rig: Callable[..., Ended], work: Path, command: tuple[str, ...]) -> None:
    run = json.loads(rig("import", "good.csv", "--kind", "poses", "--json").out)["run"]
    named, last = (rig(*command, data, "--json") for data in (run, "last"))
    assert named.status == last.status
    assert last.out.replace('"last"', f'"{run}"') == named.out
    assert (work / "good.csv").exists()


def test_python_loads_the_last_run(rig: Callable[..., Ended], work: Path) -> None:
    rig("import", "good.csv", "--kind", "poses")
    assert application.load("last").digest == application.load("good.csv").digest
