"""A file leaves rows out by its own column, as a run does by `rig exclude`."""

from __future__ import annotations

from pathlib import Path

import pytest

from calibrations.errors import DataError
from calibrations.importing.foreign import write_csv
from rig.services.tables import load
from tests.calibrations.synthetic import components, poses, turns
from tests.rig.conftest import Rig

ROWS = ["alpha_deg,beta_deg,vx_v,excluded", "90,0,3.5,0", "90,90,9.9,1", "90,180,1.5,0"]


def test_rows_that_the_file_excludes_are_left_out_with_a_remark(tmp_path: Path) -> None:
    file, said = tmp_path / "knocked.csv", []
    file.write_text("\n".join(ROWS))
    table = load(str(file), notify=said.append)
    assert list(table.column("vx_v")) == [3.5, 1.5]
    assert said == [f"{file}: 1 of 3 rows are left out: their column `excluded` is not 0."]


def test_a_file_cannot_exclude_all(golden, tmp_path: Path) -> None:
    file = tmp_path / "nothing.csv"
    file.write_text("\n".join(row[:-1] + "1" if row[0] == "9" else row for row in ROWS))
    with golden.refused(DataError):
        load(str(file))


@pytest.mark.parametrize("command", ["compare", "fit"])
def test_a_fit_of_all_rows_names_the_outliers(command: str, tmp_path: Path, rig: Rig) -> None:
    columns = turns(step_deg=30.0)
    x, y, _ = components(columns)
    volts = 2.5 + x
    volts[7] += 0.2
    write_csv(poses(columns, volts, 2.5 + y), tmp_path / "knocked.csv")
    said = rig(command, str(tmp_path / "knocked.csv"), "--model", "linear")
    assert said.status == 0
    outlier = "1 pose differs from the others: #7 (counted from 0, including excluded poses), still in this fit"
    assert outlier in said.out
    assert "rig exclude" in said.out
