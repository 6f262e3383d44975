"""A file leaves rows out by its own column, as a run does by `rig exclude`."""

from __future__ import annotations

from pathlib import Path

import pytest

from calibrations.errors import DataError
from rig.data import load

ROWS = ["alpha_deg,beta_deg,vx_v,excluded", "90,0,3.5,0", "90,90,9.9,1", "90,180,1.5,0"]


def test_rows_that_the_file_excludes_are_left_out_and_that_is_said(tmp_path: Path) -> None:
    file, said = tmp_path / "knocked.csv", []
    file.write_text("\n".join(ROWS))
    table = load(str(file), tell=said.append)
    assert list(table.column("vx_v")) == [3.5, 1.5]
    assert said == [f"{file}: 1 of 3 rows are left out, by its column `excluded`."]


def test_a_file_cannot_exclude_all(tmp_path: Path) -> None:
    file = tmp_path / "nothing.csv"
    file.write_text("\n".join(row[:-1] + "1" if row[0] == "9" else row for row in ROWS))
    with pytest.raises(DataError, match="every row is left out"):
        load(str(file))
