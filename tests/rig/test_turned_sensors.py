"""Magnetometers and gyroscopes through the commands: from a file to the effect, the matrices and the report."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calibrations.importing.foreign import write_csv
from calibrations.table import Table
from tests.calibrations import turned
from tests.rig.conftest import Rig


def written(table: Table, path: Path) -> str:
    write_csv(table, path)
    return str(path)


@pytest.fixture
def magnetometer(tmp_path: Path) -> str:
    return written(turned.sap6("HC"), tmp_path / "hc.csv")


@pytest.fixture
def gyroscope(tmp_path: Path) -> str:
    return written(turned.gyroscope(seed=5, lean_deg=0.4), tmp_path / "gyro.csv")


def test_a_magnetometer_begins_with_the_field_alone(rig: Rig, magnetometer: str, tmp_path: Path) -> None:
    said = rig("discover", magnetometer, "--out", str(tmp_path / "found.yaml"), "--json")
    found = said.document
    assert found["causes"] == ["hard-iron", "soft-iron"]
    hard, soft = found["steps"]
    assert hard["excess_before"] > 5 * hard["excess_after"]
    assert soft["excess_before"] > 20 * soft["excess_after"]
    assert "the residual of an ellipsoid counts as noise" in said.err
    again = rig("fit", magnetometer, "--model", str(tmp_path / "found.yaml"), "--json").document
    assert 1e3 * again["rmse"]["norm"] == pytest.approx(0.76, abs=0.01)
    assert np.shape(again["calibration"]["M"]["value"]) == (3, 3)


@pytest.mark.slow
def test_every_command_takes_a_magnetometer(rig: Rig, magnetometer: str, tmp_path: Path) -> None:
    model = str(tmp_path / "hard.yaml")
    assert "+ hard-iron" in rig("add", "hard-iron", "--model", "field", "--data", magnetometer, "--out", model).out
    assert "side " in rig("compare", magnetometer, "--model", model).out
    assert 'The model "field+hard-iron" misses soft-iron.' in rig("diagnose", magnetometer, "--model", model).out
    page = tmp_path / "report.html"
    assert rig("report", magnetometer, "--model", "field", "--out", str(page)).status == 0
    assert "‰ of the field" in page.read_text(encoding="utf-8")


def test_a_fit_of_a_single_turn_lists_the_effects_that_it_cannot_show(rig: Rig, tmp_path: Path) -> None:
    t = np.radians(np.arange(0.0, 360.0, 10.0))
    outputs = np.column_stack([22 * np.cos(t) + 5, 18 * np.sin(t) - 3, np.full(36, 40.0) + 0.01 * np.sin(7 * t)])
    turn = written(turned.magnetometer(outputs), tmp_path / "turn.csv")
    said = rig("fit", turn)
    assert "hard-iron and soft-iron cannot be tested" in said.out
    assert "hard iron 5, -3 uT; soft iron in the plane: radii 22 and 18 uT" in said.out
    assert "hard iron of z is unknown: also turn the sensor" in said.out
    refused = rig("fit", turn, "--model", "magnetometer")
    assert refused.status == 2
    assert "hard-iron is not fitted: the orientations cover too little of the sphere" in refused.err


@pytest.mark.slow
def test_every_command_takes_a_gyroscope(rig: Rig, gyroscope: str, tmp_path: Path) -> None:
    model = str(tmp_path / "found.yaml")
    said = rig("discover", gyroscope, "--out", model, "--json")
    assert said.document["causes"] == ["gyro-misalignment"]
    assert "give the constant latitude_deg" in said.err
    assert "rate " in rig("compare", gyroscope).out
    assert 'The model "gyroscope" misses gyro-misalignment.' in rig("diagnose", gyroscope).out
    fitted = rig("fit", gyroscope, "--model", model, "--json").document["calibration"]
    assert fitted["unit"] == {"from": "count", "to": "deg/s"}
    assert np.diag(fitted["S"]["value"]) == pytest.approx([1 / 16.0, 1 / 15.5, 1 / 16.4], rel=1e-3)
    page = tmp_path / "report.html"
    assert rig("report", gyroscope, "--model", "gyroscope", "--out", str(page)).status == 0
    assert "mdeg/s" in page.read_text(encoding="utf-8")
