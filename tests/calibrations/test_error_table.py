"""A stage's error table: exact at its points, periodic, never turning back, silent where nothing was measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calibrations.errors import DataError
from calibrations.geometry.error_table import ErrorTable, read_error_table

EVERY_30 = np.arange(0.0, 360.0, 30.0)


def wave(angle_deg: np.ndarray) -> np.ndarray:
    """An eccentricity of 0.07 deg and a second wave of 0.01 deg."""
    return 0.07 * np.sin(np.radians(angle_deg - 30)) + 0.01 * np.cos(np.radians(2 * angle_deg))


def table(angles: np.ndarray, std: float = 0.001) -> ErrorTable:
    return ErrorTable(tuple((float(a), float(e), std) for a, e in zip(angles, wave(angles), strict=True)))


def test_points_are_met_on_every_turn() -> None:
    for turn in (-720.0, -360.0, 0.0, 360.0):
        true, std = table(EVERY_30).true_deg(EVERY_30 + turn)
        np.testing.assert_allclose(true, EVERY_30 + turn + wave(EVERY_30), atol=1e-12)
        np.testing.assert_allclose(std, 0.001)


def test_between_points_30_deg_apart_a_wave_is_met_within_a_hundredth() -> None:
    angles = np.linspace(-180, 400, 581)
    true, _ = table(EVERY_30).true_deg(angles)
    assert np.abs(true - angles - wave(angles)).max() < 0.0013  # of 0.08; straight lines would leave 0.0033
    lines = np.interp(angles % 360, np.append(EVERY_30, 360), wave(np.append(EVERY_30, 360)))
    assert np.abs(lines - wave(angles)).max() > 0.003


def test_the_true_angle_never_turns_back() -> None:
    rough = ErrorTable(
        ((0, 0, 0.1), (10, 9.9, 0.1), (20, 0, 0.1), (30, -9.0, 0.1), *((a, 0, 0.1) for a in range(40, 360, 10)))
    )
    true, _ = rough.true_deg(np.linspace(0, 720, 7201))
    assert (np.diff(true) > 0).all()
    with pytest.raises(DataError, match="turns backwards after 10 deg"):
        ErrorTable(((0, 0, 0.1), (10, 9.9, 0.1), (20, -0.2, 0.1)))


def test_uncertainties_are_those_of_the_points_and_linear_between() -> None:
    _, std = ErrorTable(((0, 0.1, 0.002), (30, 0.1, 0.004), (60, 0.1, 0.004))).true_deg([0, 15, 375])
    np.testing.assert_allclose(std, [0.002, 0.003, 0.003])


def test_a_turn_that_closes_has_the_mean_of_both_ends() -> None:
    closed = ErrorTable(((0, 0.010, 0.001), (30, 0, 0.001), (330, 0, 0.001), (360, 0.014, 0.003)))
    true, std = closed.true_deg([0.0, 360.0])
    np.testing.assert_allclose(true, [0.012, 360.012])
    np.testing.assert_allclose(std, 0.003)


def test_outside_of_a_partial_table_nothing_is_made_up() -> None:
    partial = table(np.arange(-90.0, 91.0, 30.0))
    end = 90 + wave(np.array([90.0]))
    np.testing.assert_allclose(partial.true_deg([90.5])[0], end + 0.5, atol=1e-12)  # the edge's own error
    with pytest.raises(DataError, match=r"at 150 deg the stage's error table has no point between 90 and 270 deg"):
        partial.true_deg([0.0, 150.0])
    with pytest.raises(DataError, match="at -92 deg"):
        partial.true_deg(-92.0)


def test_a_file_is_read_with_its_remarks(tmp_path: Path) -> None:
    path = tmp_path / "beta.csv"
    path.write_text(
        "# autocollimator A7, 12-sided polygon\nangle_deg,error_deg,std_deg\n0,0.01,0.001\n90, -0.02, 0.001\n"
    )
    assert read_error_table(path) == ((0.0, 0.01, 0.001), (90.0, -0.02, 0.001))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("angle_deg,error_deg\n0,1\n", "std_deg is missing"),
        ("", "angle_deg is missing"),
        ("angle_deg,error_deg,std_deg\n0,0,0\n30,x,0\n", "point 2 is 30, x, 0; give three numbers"),
        ("angle_deg,error_deg,std_deg\n0,0\n", "point 1 is 0, 0, None"),
    ],
)
def test_a_wrong_error_table_is_refused_with_its_fault(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "beta.csv"
    path.write_text(text)
    with pytest.raises(DataError, match=said) as error:
        read_error_table(path)
    assert str(error.value).startswith(str(path))


@pytest.mark.parametrize("points", [(), ((0, float("nan"), 0.1),), ((0, 0, -0.1),)])
def test_an_impossible_error_table_is_refused(points: tuple[tuple[float, float, float], ...]) -> None:
    with pytest.raises(DataError, match="error table"):
        ErrorTable(points)
