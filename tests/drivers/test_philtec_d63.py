"""The calibration of a displacement sensor: what is on the curve, what is not, and what is no curve."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.errors import SensorFault
from drivers.philtec_d63 import SIMULATED, CalibrationCurve

SHEET: dict[str, Any] = {
    "serial": 4711,
    "date": "2026-03-01",
    "near": [[50, 0.5], [100, 1.5], [150, 3.0], [200, 4.0]],
    "far": [[400, 4.0], [600, 3.0], [900, 2.0], [1500, 1.0]],
}


@pytest.fixture
def curve() -> CalibrationCurve:
    return CalibrationCurve.from_mapping(SHEET)


def test_it_goes_through_the_points_of_the_sheet(curve: CalibrationCurve) -> None:
    for side in ("near", "far"):
        gaps, volts = np.array(SHEET[side]).T
        assert curve.displacement_um(volts, side) == pytest.approx(gaps)
    assert (curve.serial, curve.date) == ("4711", "2026-03-01")


def test_between_the_points_it_is_monotone(curve: CalibrationCurve) -> None:
    volts = np.linspace(1.0, 4.0, 1000)
    assert np.all(np.diff(curve.displacement_um(volts, "near")) > 0)
    assert np.all(np.diff(curve.displacement_um(volts, "far")) < 0)


def test_the_shape_is_that_of_the_volts(curve: CalibrationCurve) -> None:
    assert curve.displacement_um(2.0).shape == ()
    assert curve.displacement_um([[1.0, 2.0, 3.0]]).shape == (1, 3)
    assert curve.displacement_um([]).shape == (0,)


@pytest.mark.parametrize(
    ("volts", "side", "words"),
    [
        (4.01, "near", r"the reading, 4.0100 V, .* above 4 V .* optical peak, where .* Move the tip closer"),
        (4.01, "far", r"above 4 V .* optical peak, where .* Move the tip away"),
        (0.49, "near", r"is outside the near side of the calibration curve of 2026-03-01: 0.5 .. 4 V. Check lamp"),
        ([1.0, 2.0, 9.0], "near", r"D63 4711: reading 2 of 3, 9.0000 V"),
        (math.nan, "near", r"nan V, is outside the near side"),
    ],
)
def test_a_reading_off_the_curve_is_no_number(curve: CalibrationCurve, volts: Any, side: Any, words: str) -> None:
    with pytest.raises(SensorFault, match=words):
        curve.displacement_um(volts, side)


def test_a_side_that_was_not_calibrated() -> None:
    near_only = CalibrationCurve.from_mapping({key: value for key, value in SHEET.items() if key != "far"})
    with pytest.raises(SensorFault, match="has no far side"):
        near_only.displacement_um(2.0, "far")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"near": [[50, 0.5], [100, 1.5]]}, "near side of D63 4711: needs 4 points or more, has 2"),
        ({"near": [[50, 0.5], [100, 1.5], [150, 1.4], [200, 4.0]]}, r"from \(100.0, 1.5\) to .* the output rise"),
        ({"far": [[400, 4.0], [600, 3.0], [900, 3.1], [1500, 1.0]]}, "the output fall"),
        ({"near": [[50, 0.5], [40, 1.5], [150, 2.0], [200, 4.0]]}, "the gap must grow"),
        ({"near": [[50, 0.5], [100, math.nan], [150, 3.0], [200, 4.0]]}, "the output rise"),
        ({"near": [50, 100]}, "near: must be a list of pairs"),
        ({"neer": []}, "neer: not a key of a D63's curve; the keys are serial, date, near, far"),
    ],
)
def test_what_is_no_curve_is_refused(change: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        CalibrationCurve.from_mapping(SHEET | change)


def test_a_curve_without_a_date_is_refused() -> None:
    with pytest.raises(ValueError, match="date: missing"):
        CalibrationCurve.from_mapping({key: value for key, value in SHEET.items() if key != "date"})


@pytest.mark.parametrize("text", ["- 1", "serial: [", "serial: 3\ndate: x\nnear: 5"])
def test_an_unusable_curve_file_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "curve.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"curve\.yaml: "):
        CalibrationCurve.from_file(path)
    with pytest.raises(ValueError, match=r"none\.yaml"):
        CalibrationCurve.from_file(tmp_path / "none.yaml")


def test_the_shipped_curve_is_read() -> None:
    assert CalibrationCurve.from_file(SIMULATED).serial == "SIM-0063"
