"""Allan deviation of noise whose deviation is known."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.evaluations.allan import allan_deviation


def test_white_noise_falls_with_the_square_root_of_time() -> None:
    stretches = np.random.default_rng(1).standard_normal((20, 1000))
    times_s, deviations = allan_deviation(list(stretches), 10.0)
    assert times_s.tolist() == [10.0 * 2**k for k in range(9)]
    assert deviations[:6] == pytest.approx(np.sqrt(10 / times_s[:6]), rel=0.1)


def test_a_straight_drift_rises_with_time() -> None:
    times_s, deviations = allan_deviation([0.1 * np.arange(64.0)], 1.0)
    assert deviations == pytest.approx(0.1 * times_s / np.sqrt(2))


def test_stretches_that_are_too_short_have_none() -> None:
    times_s, deviations = allan_deviation([np.ones(1), np.ones(1)], 1.0)
    assert len(times_s) == len(deviations) == 0
