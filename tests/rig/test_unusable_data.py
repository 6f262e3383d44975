"""Commands on an output that does not respond: exit status 1, the reason, and nothing that leaves the lab."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calibrations.discovery.plausibility import findings
from calibrations.importing.foreign import write_csv
from calibrations.table import Table
from tests.calibrations.test_plausibility import DEAD, healthy, two_sensors
from tests.rig.conftest import Rig
from tests.rig.measurement_files import GOOD
from tests.rig.wrong_measurements import WRONG

REASON = "vx_v is constant"


@pytest.fixture
def dead(tmp_path: Path) -> str:
    write_csv(DEAD["constant"][0](healthy()).table(), tmp_path / "dead.csv")
    return str(tmp_path / "dead.csv")


@pytest.mark.parametrize("command", ["fit", "compare", "diagnose", "discover"])
def test_exit_status_and_verdict_without_check(rig: Rig, dead: str, command: str) -> None:
    ended = rig(command, dead, "--json")
    assert ended.status == 1, ended.err
    document = ended.document
    assert document["verdict"] == "no-response"
    assert REASON in document["residual_structure"]
    assert REASON in rig(command, dead).out


def test_unusable_data_write_no_file(rig: Rig, dead: str, tmp_path: Path) -> None:
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


def test_an_axis_of_noise_shows_in_the_magnitude_of_the_others(rig: Rig, tmp_path: Path) -> None:
    file, path = WRONG["positions"]["an axis holds noise only"](GOOD["positions"]()), tmp_path / "dead.csv"
    path.write_text(file.text())
    for command, out in (("fit", "m.yaml"), ("certificate", "c.xml")):
        ended = rig(command, str(path), "--model", file.model, "--out", str(tmp_path / out))
        assert (ended.status, "az changes by only" in ended.out + ended.err) == (1, True), ended
    assert list(tmp_path.iterdir()) == [path]


def test_an_axis_that_no_position_turns_is_not_dead() -> None:
    turn = np.radians(np.arange(0.0, 360.0, 15.0))
    noise = 1e-4 * np.random.default_rng(2).standard_normal((3, len(turn)))
    columns = {"ax": np.cos(turn) + noise[0], "ay": np.sin(turn) + noise[1], "az": 0.01 + noise[2]}
    assert findings(Table.from_columns("positions", columns, source="made")) == ()


@pytest.mark.parametrize("share", [0.05, 0.1])
def test_values_that_cannot_be_used_are_not_certified(rig: Rig, tmp_path: Path, share: float) -> None:
    """An output that died at the end of the run: too few rows to tell it from other mistakes."""
    file = GOOD["poses"]()
    dead = file.changed(vx_v=np.where(np.arange(file.n) > (1 - share) * file.n, 2.5, file.columns["vx_v"]))
    (tmp_path / "dead.csv").write_text(dead.text())
    ended = rig("certificate", str(tmp_path / "dead.csv"), "--model", "linear", "--out", str(tmp_path / "c.xml"))
    assert (ended.status, "do not use the values" in ended.err) == (1, True), ended
    assert not (tmp_path / "c.xml").exists()


@pytest.mark.parametrize("command", ["fit", "compare", "diagnose", "discover"])
def test_two_sensors_fail_every_check(rig: Rig, tmp_path: Path, command: str) -> None:
    path = tmp_path / "two.csv"
    write_csv(two_sensors(healthy()).table(), path)
    assert rig(command, str(path)).status == 0
    ended = rig(command, str(path), "--check")
    assert (ended.status, "two groups of rows" in ended.out) == (1, True), ended
    assert rig("certificate", str(path), "--model", "linear", "--out", str(tmp_path / "c.xml")).status == 1
    assert not (tmp_path / "c.xml").exists()
