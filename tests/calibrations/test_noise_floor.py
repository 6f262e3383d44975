"""The noise of a still record: its value, and an uncertainty that holds where samples are correlated."""

import numpy as np
import pytest
from scipy.signal import lfilter

from calibrations.analyses.noise_floor import hidden_inclination_deg, noise_rms
from calibrations.errors import DataError

SEEDS = 200


def filtered(seed: int, n: int = 20_000, corner: float = 15.07 / 1000) -> np.ndarray:
    """White noise behind a first-order low-pass, of variance 1."""
    keep = np.exp(-2 * np.pi * corner)
    white = np.random.default_rng(seed).normal(0, np.sqrt(1 - keep**2), n + 2000)
    return np.asarray(lfilter([1.0], [1.0, -keep], white)[2000:])


def test_its_standard_error_is_the_scatter_over_many_records() -> None:
    values, stds = np.array([noise_rms(np.split(filtered(seed), 4)) for seed in range(SEEDS)]).T
    assert values.mean() == pytest.approx(1.0, abs=0.01)
    assert stds.mean() == pytest.approx(values.std(), rel=0.2)


def test_independent_samples_have_the_textbook_error() -> None:
    value, std = noise_rms([np.random.default_rng(1).normal(5.0, 2.0, 10_000)])
    assert value == pytest.approx(2.0, abs=4 * std)
    assert std == pytest.approx(2.0 / np.sqrt(2 * 10_000), rel=0.05)


@pytest.mark.parametrize("samples", [np.full(100, 2.5), np.array([1.0])])
def test_a_record_without_noise_is_no_record(golden, samples: np.ndarray) -> None:
    with golden.refused(DataError):
        noise_rms([samples])


def test_the_noise_of_the_paper_hides_its_inclination() -> None:
    assert hidden_inclination_deg(3.1e-3, 1.0) == pytest.approx(0.18, abs=0.005)  # Ang V: about 0.2 deg
