"""The displacement sensor's law, and that the calibration that is shipped is one of it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from drivers.philtec_d63 import SIMULATED, CalibrationCurve
from drivers.world.displacement_sensor import FibreProbe, certificate, seen_v
from drivers.world.kernel import record

PROBE = record(FibreProbe())


def test_it_has_a_near_side_a_peak_and_a_far_side() -> None:
    peak = minimize_scalar(lambda gap: -seen_v(PROBE, gap), bounds=(0, 1000), method="bounded")
    assert -peak.fun == pytest.approx(PROBE.peak_v)
    width = PROBE.spot_um + 2 * peak.x * np.tan(np.radians(PROBE.divergence_deg))
    assert width**2 == pytest.approx(2 * PROBE.spacing_um**2, rel=1e-4)
    gaps = np.linspace(0, 3000, 301)
    steps = np.diff([seen_v(PROBE, gap) for gap in gaps])
    assert np.all(steps[gaps[1:] < peak.x] > 0)
    assert np.all(steps[gaps[:-1] > peak.x] < 0)
    assert seen_v(PROBE, -5.0) == seen_v(PROBE, 0.0)


def test_the_travel_of_the_carriage_is_on_the_near_side() -> None:
    curve = CalibrationCurve.from_file(SIMULATED)
    low, high = curve.near[0][0], curve.near[-1][0]
    assert low < PROBE.standoff_um < PROBE.standoff_um + 100 < high


def test_the_shipped_calibration_is_that_of_the_simulated_sensor() -> None:
    assert SIMULATED.read_text(encoding="utf-8") == certificate(FibreProbe())


@pytest.mark.parametrize(("side", "low", "high", "error_um"), [("near", 150, 250, 0.02), ("far", 600, 1900, 0.15)])
def test_its_errors_are_those_of_a_calibration(side: str, low: float, high: float, error_um: float) -> None:
    """Small, and not zero: the curve is measured, not the law itself."""
    gaps = np.linspace(low, high, 2001)
    volts = [seen_v(PROBE, gap) for gap in gaps]
    errors = CalibrationCurve.from_file(SIMULATED).displacement_um(volts, side) - gaps
    assert 1e-4 < np.abs(errors).max() < error_um
