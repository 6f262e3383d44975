"""Logs of a gyroscope alone that a person turned by whole turns on a table: rests, turns, rates and axes are found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibrations.analyses.hand_turns import fit_turns
from calibrations.errors import DataError, MissingColumn, MissingConstant, ModelError
from calibrations.importing.binary import open_sheet
from calibrations.importing.foreign import needs_mapping
from calibrations.importing.proposal import missing_columns
from calibrations.importing.raw_logs import average_raw_log
from calibrations.presentation.certificate.results import figures, require_reference
from calibrations.table import Table
from tests.foreign_files import read_foreign

RATE_HZ = 100.0
BIAS = np.array([0.3, -0.2, 0.1])
MATRIX = np.diag([1.02, 0.97, 1.01]) + np.array([[0, 0.01, 0], [0, 0, 0], [-0.008, 0, 0]])
TURN = {"turn_deg": 360.0}


def rest(duration_s: float = 2.5) -> np.ndarray:
    return np.zeros((round(duration_s * RATE_HZ), 3))


def turn(axis: np.ndarray, angle_deg: float, duration_s: float = 4.0) -> np.ndarray:
    """An unsteady hand."""
    k = np.arange(round(duration_s * RATE_HZ))
    share = np.sin(np.pi * (k + 0.5) / len(k)) ** 2 * (1 + 0.4 * np.sin(0.3 * k))
    return np.outer(share * angle_deg * RATE_HZ / share.sum(), axis)


def log(folder: Path, angles_deg: tuple[float, ...] = (360.0,) * 6, times: bool = True) -> Path:
    """A turn on each face, with a movement to the next face after it."""
    rng, parts = np.random.default_rng(3), [rest()]
    for k, angle_deg in enumerate(angles_deg):
        face = np.eye(3)[k // 2] * (1 - 2 * (k % 2))
        parts += [turn(face, angle_deg), rest(), turn(np.roll(face, 1), 180.0 if k % 2 == 0 else 90.0, 1.5), rest()]
    rates = np.vstack(parts)
    outputs = BIAS + rates @ MATRIX.T + 0.03 * rng.standard_normal(rates.shape)
    columns = np.column_stack([np.arange(len(rates)) / RATE_HZ, outputs])
    header = "t_s,gx (deg/s),gy (deg/s),gz (deg/s)"
    path = folder / "gyroscope.csv"
    chosen = columns if times else columns[:, 1:]
    np.savetxt(path, chosen, "%.5f", ",", header=header if times else header[4:], comments="")
    return path


def means(path: Path, **constants: float) -> Table:
    return average_raw_log(read_foreign(path, "rates", constants={**TURN, **constants}))


def test_each_turn_has_its_angle_over_its_time_and_its_axis(tmp_path: Path) -> None:
    table = means(log(tmp_path))
    rates = table.column("rate_deg_s")
    assert np.count_nonzero(rates) == 6
    assert table.n == 6 + 12  # a rest before each turn and one after it
    assert np.all(rates >= 0)
    axes = np.column_stack([table.column(f"axis_{axis}") for axis in "xyz"])[rates > 0]
    np.testing.assert_array_equal(axes, [np.eye(3)[k // 2] * (1 - 2 * (k % 2)) for k in range(6)])
    assert rates[rates > 0] == pytest.approx(np.full(6, 360 / 4.4), rel=0.05)  # the rests are cut at their ends


def test_the_fit_finds_bias_scale_and_misalignment_without_another_sensor(tmp_path: Path) -> None:
    fitted = fit_turns(means(log(tmp_path)))
    for k, axis in enumerate("xyz"):
        assert fitted.params[f"gyro-bias.{axis}"].value == pytest.approx(BIAS[k], abs=5e-3)
        along = float(np.linalg.norm(MATRIX[k]))
        assert fitted.params[f"gyro-scale-factor.{axis}"].value == pytest.approx(along, rel=1e-3)
    assert fitted.params["gyro-misalignment.xy"].value == pytest.approx(np.degrees(0.01 / 1.02), abs=0.02)
    assert fitted.params["gyro-misalignment.zx"].value == pytest.approx(-np.degrees(0.008 / 1.01), abs=0.02)


def test_clockwise_turns_are_stated_by_a_negative_angle(tmp_path: Path) -> None:
    path = log(tmp_path, (-360.0,) * 6)
    table = average_raw_log(read_foreign(path, "rates", constants={"turn_deg": -360.0}))
    assert table.column("rate_deg_s").min() < -70
    assert fit_turns(table).params["gyro-scale-factor.x"].value == pytest.approx(1.02, rel=1e-3)


def test_a_turn_that_is_not_whole_is_refused_with_its_place(tmp_path: Path) -> None:
    path = log(tmp_path, (360.0, 360.0, 360.0, 300.0, 360.0, 360.0))
    with pytest.raises(DataError, match=r"by gy the turn that begins \d+\.\d s after .* of the others about y; each"):
        read_foreign(path, "rates", constants=TURN)


def test_without_a_turn_a_time_or_the_angle_the_log_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="found no turn between two rests"):
        read_foreign(log(tmp_path, ()), "rates", constants=TURN)
    with pytest.raises(MissingConstant, match="needs the column t_s, or the constant sample_rate_hz"):
        read_foreign(log(tmp_path, times=False), "rates", constants=TURN)
    assert means(log(tmp_path, times=False), sample_rate_hz=RATE_HZ).n == 18
    with pytest.raises(MissingColumn, match="rate_deg_s"):
        read_foreign(log(tmp_path), "rates")
    with pytest.raises(DataError, match="the constant turn_deg is once; give the angle"):
        read_foreign(log(tmp_path), "rates", constants={"turn_deg": "once"})


def test_whole_turns_are_certified_and_turns_between_rests_are_not(tmp_path: Path) -> None:
    fitted = fit_turns(means(log(tmp_path)))
    certified = {outcome.name: outcome for outcome in figures(fitted, None, {}, trials=200).outcomes}
    scale = certified["gyro-scale-factor-x"]
    assert abs(scale.value - np.linalg.norm(MATRIX[0])) < scale.coverage * scale.std < 5e-3
    with pytest.raises(ModelError, match=r"come from an accelerometer .* Certify known rates .* or whole turns"):
        require_reference("a log", "turns")


def test_the_angle_of_each_turn_takes_the_place_of_a_column_of_rates(tmp_path: Path) -> None:
    sheet = open_sheet(log(tmp_path))
    assert needs_mapping(sheet, "rates", [])
    assert missing_columns("rates", sheet, []) == ["rate_deg_s"]
    stated = replace(sheet, constants={"turn_deg": 360.0})
    assert not needs_mapping(stated, "rates", [])
    assert missing_columns("rates", stated, []) == []
