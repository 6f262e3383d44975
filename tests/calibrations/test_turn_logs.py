"""Logs of a gyroscope and an accelerometer that a person turned from rest to rest: rests and turns are found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calibrations.analyses.hand_turns import fit_turns
from calibrations.errors import DataError, MissingConstant
from calibrations.importing.foreign import write_csv
from calibrations.importing.units import ColumnMapping
from calibrations.loop import dataset, discover
from calibrations.model.file import read_model
from calibrations.table import Table
from tests.calibrations.test_turns import BIAS, GAINS, samples
from tests.calibrations.test_turns import table as turns_table
from tests.foreign_files import read_foreign

XSENS = Path(__file__).parents[1] / "data" / "imu_tk_xsens"
FACTORY_PER_RAD_S = (4778, 4758, 4766)  # counts, of the manufacturer
COUNTS = [ColumnMapping(name, name, "count") for name in ("ax", "ay", "az", "gx", "gy", "gz")]


def log(folder: Path, turns: int = 12, *left_out: str) -> Path:
    """The samples of turns, in which neither turns nor rests are marked."""
    made = turns_table(samples(turns, noise=0.02))
    columns = {name: values for name, values in made.columns.items() if name not in ("turn", "resting", *left_out)}
    path = folder / "log.csv"
    names = list(columns)
    rows = (",".join(f"{value:.7g}" for value in row) for row in zip(*columns.values(), strict=True))
    path.write_text("\n".join([",".join(names), *rows]) + "\n")
    return path


def test_rests_and_turns_of_a_log_are_found(tmp_path: Path) -> None:
    table = read_foreign(log(tmp_path), "turns")
    assert len(set(table.column("turn"))) == 10  # the first rest and the last are too short to count
    fitted = fit_turns(table)
    for k, axis in enumerate("xyz"):
        assert fitted.params[f"gyro-bias.{axis}"].value == pytest.approx(BIAS[k], abs=5e-3)
        assert fitted.params[f"gyro-scale-factor.{axis}"].value == pytest.approx(GAINS[k, k], rel=2e-3)


def test_an_imported_log_of_turns_is_the_same_when_it_is_read_again(tmp_path: Path) -> None:
    table = read_foreign(log(tmp_path), "turns")
    write_csv(table, tmp_path / "turns.csv")
    again = read_foreign(tmp_path / "turns.csv", "turns")
    assert again.n == table.n
    np.testing.assert_array_equal(again.column("turn"), table.column("turn"))


def test_a_log_with_too_few_rests_or_without_times_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"found [0-6] rests; a gyroscope needs 7 or more"):
        read_foreign(log(tmp_path, 4), "turns")
    whole = log(tmp_path)
    whole.write_text("".join(whole.read_text().splitlines(keepends=True)[:6]))  # fewer rows than a rest has
    with pytest.raises(DataError, match=r"found 0 rests; a gyroscope needs 7 or more"):
        read_foreign(whole, "turns")
    with pytest.raises(MissingConstant, match="needs the column t_s, or the constant sample_rate_hz"):
        read_foreign(log(tmp_path, 12, "t_s"), "turns")
    assert read_foreign(log(tmp_path, 12, "t_s"), "turns", constants={"sample_rate_hz": 100.0}).kind == "turns"


@pytest.fixture(scope="module")
def xsens(tmp_path_factory: pytest.TempPathFactory) -> Table:
    force, rate = (np.loadtxt(XSENS / f"xsens_{name}.mat.txt.gz") for name in ("acc", "gyro"))
    path = tmp_path_factory.mktemp("xsens") / "xsens.csv"
    np.savetxt(path, np.column_stack([force, rate[:, 1:]]), "%.7g", ",", header="t_s,ax,ay,az,gx,gy,gz", comments="")
    return read_foreign(path, "turns", COUNTS)


def test_the_gyroscope_of_a_published_log_has_the_scale_factors_of_its_manufacturer(xsens: Table) -> None:
    assert len(set(xsens.column("turn"))) == 37  # its accelerometer has 38 rests
    fitted = fit_turns(xsens)
    for axis, per_rad_s in zip("xyz", FACTORY_PER_RAD_S, strict=True):
        scale = fitted.params[f"gyro-scale-factor.{axis}"]
        assert scale.value == pytest.approx(np.radians(per_rad_s), rel=5e-3)
        assert scale.std is not None
        assert scale.std < 2e-3 * scale.value
    assert not any("cannot be used" in caution for caution in dataset(xsens).cautions(fitted))


@pytest.mark.slow
def test_the_error_on_a_published_log_falls_to_the_noise(xsens: Table) -> None:
    found = discover(xsens, read_model("gyroscope"))
    assert found.causes == ("gyro-misalignment", "gyro-g-sensitivity")
    assert [step.after.pooled_excess for step in found.steps] == pytest.approx([4.1, 1.2], abs=0.1)
    assert found.verdict == "adequate"
