"""Deviations with every overlap, and the reference of all kinds, against published numbers and the definition."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calibrations.errors import DataError
from calibrations.noise.deviations import deviations
from tests.calibrations.exact_deviations import exact_deviations

DATA = Path(__file__).parents[1] / "data" / "allantools"
STABLE32 = {"adev": "allan", "oadev": "overlapping", "mdev": "modified", "hdev": "separate-hadamard", "totdev": "total"}
NBS14 = {  # NIST SP 1065, table 31: 1000 values, at 1, 10 and 100 times the sampling interval
    "allan": (2.922319e-01, 9.965736e-02, 3.897804e-02),
    "overlapping": (2.922319e-01, 9.159953e-02, 3.241343e-02),
    "modified": (2.922319e-01, 6.172376e-02, 2.170921e-02),
    "total": (2.922319e-01, 9.134743e-02, 3.406530e-02),
    "hadamard": (2.943883e-01, 9.581083e-02, 3.237638e-02),
    "separate-hadamard": (2.943883e-01, 1.052754e-01, 3.910860e-02),
}
NBS14_9 = (892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0)
NBS14_SHORT = {"overlapping": (91.22945, 85.95287), "modified": (91.22945, 74.78849), "total": (91.22945, 93.90379)}


def nbs14() -> np.ndarray:
    """The 1000 values of SP 1065, 12.4: a multiplicative generator modulo 2^31 - 1."""
    number, values = 1234567890, []
    for _ in range(1000):
        values.append(number / 2147483647)
        number = 16807 * number % 2147483647
    return np.array(values)


@pytest.mark.parametrize("kind", NBS14)
def test_the_thousand_points_of_sp_1065(kind: str) -> None:
    assert exact_deviations(nbs14(), (1, 10, 100), kind) == pytest.approx(NBS14[kind], rel=2e-7)


@pytest.mark.parametrize("kind", NBS14_SHORT)
def test_the_nine_points_of_nbs_monograph_140(kind: str) -> None:
    assert exact_deviations(np.array(NBS14_9), (1, 2), kind) == pytest.approx(NBS14_SHORT[kind], rel=1e-6)


@pytest.mark.parametrize("name", STABLE32)
def test_deviations_of_phase_dat_are_those_of_stable32(name: str) -> None:
    """Its example PHASE.DAT is the sum of the thousand points, less their mean."""
    published = np.loadtxt(DATA / f"phase_dat_{name}_octave.txt")
    agree(exact_deviations(nbs14(), published[:, 0].astype(int), STABLE32[name]), published[:, 5])


@pytest.mark.parametrize("name", STABLE32)
def test_stable32_on_a_real_oscillator_at_all_times(name: str) -> None:
    published = np.loadtxt(DATA / f"stable32_{name}_alltau.txt.gz")
    values = np.loadtxt(DATA / "ocxo_frequency.txt.gz") / 1e7 - 1
    agree(exact_deviations(values, published[:, 0].astype(int), STABLE32[name]), published[:, 5])


def agree(found: np.ndarray, published: np.ndarray) -> None:
    """To the five digits that are printed; Stable32 itself is off by as much as a hundredth of the last one."""
    last_digit = 10.0 ** (np.floor(np.log10(published)) - 4)
    assert np.all(np.abs(found - published) <= 0.51 * last_digit)


@pytest.mark.parametrize(("kind", "weights", "divisor"), [("overlapping", (-1, 1), 2), ("hadamard", (1, -2, 1), 6)])
def test_deviations_follow_their_definition(kind: str, weights: tuple[int, ...], divisor: int) -> None:
    values, m = np.random.default_rng(1).standard_normal(60) + 7.0, 5
    means = np.convolve(values, np.full(m, 1 / m), "valid")
    last = len(means) - (len(weights) - 1) * m
    squares = [sum(w * means[i + k * m] for k, w in enumerate(weights)) ** 2 for i in range(last)]
    assert exact_deviations(values, [m], kind)[0] == pytest.approx(np.sqrt(np.mean(squares) / divisor), rel=1e-12)


def test_the_compiled_loops_are_the_definition() -> None:
    values = np.random.default_rng(2).standard_normal(5000)
    assert deviations(values, (1, 7, 2000)) == pytest.approx(exact_deviations(values, (1, 7, 2000)), rel=1e-12)


def test_a_time_that_is_too_long_has_none() -> None:
    found = deviations(np.random.default_rng(1).standard_normal(20), (10, 11, 40))
    assert np.isfinite(found).tolist() == [True, False, False]


def test_samples_that_are_no_numbers_and_a_time_of_zero_are_refused(golden) -> None:
    with golden.refused(DataError):
        deviations(np.array([1.0, 2.0, np.nan]), [1])
    with golden.refused(DataError):
        deviations(np.ones(3), [0])
