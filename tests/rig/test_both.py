"""Two tables by one model: the same poses are found in both, each visit once, and what is of two kinds is refused."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from calibrations.fitting.fit import Fit, fit
from calibrations.importing.foreign import write_csv
from calibrations.model.file import read_model
from calibrations.table import Table
from rig.errors import RecordError
from rig.services.load import still_of
from rig.services.request import Request
from rig.services.two_runs import fit_both, match_poses

ALPHA, BETA = (each.ravel() for each in np.meshgrid([30.0, 90.0, 150.0], np.arange(0.0, 360.0, 30.0)))


def table(rows: Sequence[int], offset_v: float = 0.0) -> Table:
    """Rows of a grid of poses, by an ideal sensor with a bias."""
    a, b = np.radians(ALPHA[rows]), np.radians(BETA[rows])
    volts = {"vx_v": 2.5 + np.sin(a) * np.cos(b) + offset_v, "vy_v": 2.5 + np.sin(a) * np.sin(b) + offset_v}
    columns = {"alpha_deg": ALPHA[rows], "beta_deg": BETA[rows], "vx_std_v": np.full(len(rows), 1e-3)}
    extra = {"vy_std_v": np.full(len(rows), 1e-3), "n": np.full(len(rows), 100.0), **volts}
    return Table.from_columns("poses", columns | extra, {}, "a table")


def fitted(rows: Sequence[int], offset_v: float = 0.0) -> Fit:
    return fit(read_model("linear"), table(rows, offset_v))


def test_poses_that_both_have_are_paired_whatever_their_order() -> None:
    first, second = fitted(range(36)), fitted([*range(35, 9, -1)], 1e-3)
    found = match_poses(first, second)
    assert found is not None
    assert np.array_equal(first.table.column("beta_deg")[found.first], second.table.column("beta_deg")[found.second])
    assert found.difference.shape == (2, 26)
    assert found.difference == pytest.approx(1e-3)
    assert found.floor == pytest.approx(np.sqrt(2) * first.noise.floor)


def test_a_pose_visited_twice_is_paired_visit_by_visit() -> None:
    found = match_poses(fitted([*range(36), 0, 0]), fitted([*range(36), 0]))
    assert found is not None
    assert len(found.first) == 37
    assert sorted(found.first[(found.first == 0) | (found.first >= 36)]) == [0, 36]


def test_without_a_pose_in_common_there_is_nothing() -> None:
    assert match_poses(fitted(range(18)), fitted(range(18, 36))) is None


@pytest.mark.slow
def test_a_still_record_and_poses_have_no_model_in_common(golden, tmp_path: Path) -> None:
    write_csv(table(range(36)), poses := tmp_path / "poses.csv")
    rows = {"vx_v": 2.5 + 1e-3 * np.random.default_rng(1).standard_normal(5000)}
    write_csv(Table.from_columns("still", rows, {"sample_rate_hz": 10.0}, "still"), still := tmp_path / "still.csv")
    with golden.refused(RecordError):
        fit_both(Request(str(poses)), Request(str(still)), print)


@pytest.mark.parametrize(
    ("constants", "columns", "expected"),
    [
        ({"output_per_g": -0.5}, ("vx_v",), (2.0, "g")),
        ({"output_per_deg_s": 0.02}, ("vx_v",), (50.0, "deg/s")),
        ({"output_per_field": 4.0}, ("vx_v",), (0.25, "field")),
        ({"unit": "m/s^2"}, ("ax",), (1 / 9.80665, "g")),
        ({"output_per_g": "a lot"}, ("vx_v",), None),
        ({}, ("vx_v",), None),
    ],
)
def test_a_still_record_with_a_stated_scale_factor_is_shown_in_the_sensed_unit(
    tmp_path: Path, constants: dict[str, str | float], columns: tuple[str, ...], expected: tuple[float, str] | None
) -> None:
    rows = dict.fromkeys(columns, 2.5 + 1e-3 * np.random.default_rng(1).standard_normal(5000))
    made = Table.from_columns("still", rows, {"sample_rate_hz": 10.0, **constants}, "still")
    write_csv(made, path := tmp_path / "still.csv")
    found = still_of(Request(str(path)), print)
    sensed = found.sensed.get("x")
    assert (None if sensed is None else (pytest.approx(sensed.factor), sensed.unit)) == expected
