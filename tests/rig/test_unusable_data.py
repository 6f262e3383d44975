"""Commands on an output that does not respond: exit status 1, the reason, and nothing that leaves the lab."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from calibrations.importing.foreign import write_csv
from tests.calibrations.test_plausibility import DEAD, healthy, two_sensors

REASON = "vx_v is constant"


@pytest.fixture
def dead(tmp_path: Path) -> str:
    write_csv(DEAD["constant"][0](healthy()).table(), tmp_path / "dead.csv")
    return str(tmp_path / "dead.csv")


@pytest.mark.parametrize("command", ["fit", "compare", "diagnose", "discover"])
def test_exit_status_and_verdict_without_check(rig: Callable[..., Any], dead: str, command: str) -> None:
    ended = rig(command, dead, "--json")
    assert ended.status == 1, ended.err
    document = json.loads(ended.out)
    assert document["verdict"] == "no-response"
    assert REASON in document["residual_structure"]
    assert REASON in rig(command, dead).out


def test_nothing_is_written(rig: Callable[..., Any], dead: str, tmp_path: Path) -> None:
    out = str(tmp_path / "out")
    for arguments in (
        ("fit", dead, "--out", f"{out}.yaml"),
        ("discover", dead, "--out", f"{out}.yaml"),
        ("add", "cubic-nonlinearity", "--model", "linear", "--data", dead, "--out", f"{out}.yaml"),
        ("certificate", dead, "--model", "linear", "--out", f"{out}.xml"),
        ("report", dead, "--model", "linear", "--out", f"{out}.html"),
    ):
        ended = rig(*arguments)
        assert (ended.status, REASON in ended.out + ended.err) == (1, True), ended
    assert [path.name for path in tmp_path.iterdir()] == ["dead.csv"]


@pytest.mark.parametrize("command", ["fit", "compare", "diagnose", "discover"])
def test_two_sensors_fail_every_check(rig: Callable[..., Any], tmp_path: Path, command: str) -> None:
    path = tmp_path / "two.csv"
    write_csv(two_sensors(healthy()).table(), path)
    assert rig(command, str(path)).status == 0
    ended = rig(command, str(path), "--check")
    assert (ended.status, "two groups of rows" in ended.out) == (1, True), ended
    assert rig("certificate", str(path), "--model", "linear", "--out", str(tmp_path / "c.xml")).status == 1
    assert not (tmp_path / "c.xml").exists()
