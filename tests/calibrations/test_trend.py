"""A straight line through repeated measurements, and an uncertainty that holds."""

import numpy as np
import pytest

from calibrations.analyses.stability import fit_trend
from calibrations.errors import TooFewRows


def test_its_standard_error_is_the_scatter_over_many_records() -> None:
    hours = np.array([0.0, 0.3, 0.9, 1.4, 2.0, 2.2])
    random = np.random.default_rng(1)
    found = np.array([fit_trend(hours, 2.5 + 3e-4 * hours + random.normal(0, 5e-5, 6)) for _ in range(2000)])
    slopes, stds = found.T
    assert slopes.mean() == pytest.approx(3e-4, abs=4 * slopes.std() / np.sqrt(2000))
    assert np.sqrt(np.mean(stds**2)) == pytest.approx(slopes.std(), rel=0.05)


def test_two_measurements_have_no_trend(golden) -> None:
    with golden.refused(TooFewRows):
        fit_trend(np.array([0.0, 1.0]), np.array([1.0, 2.0]))
