"""Deviations in one pass: the same as with every overlap, whatever the blocks, the mean, and the type of samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibrations.noise.deviations import (
    OCTAVE_KINDS,
    Octaves,
    freedom,
    interval,
    moments_of,
    noise_type,
    octaves,
    overlap_of,
)
from tests.calibrations.exact_deviations import exact_deviations
from tests.calibrations.noises import flicker, quantisation, random_walk

GRID = 2.0**-20
NOISES = {
    2: quantisation,
    0: lambda random, n: random.standard_normal(n),
    -1: flicker,
    -2: random_walk,
}


@pytest.mark.parametrize("kind", ["overlapping", "hadamard", "total"])
def test_up_to_32_samples_every_overlap_is_used(kind: str) -> None:
    samples = np.random.default_rng(1).standard_normal(5000)
    curve = octaves([samples], 1.0, kind)
    assert curve.tau_s[:6].tolist() == [1, 2, 4, 8, 16, 32]
    assert curve.deviation[:6] == pytest.approx(exact_deviations(samples, (1, 2, 4, 8, 16, 32), kind), rel=1e-12)


@pytest.mark.parametrize("kind", OCTAVE_KINDS)
def test_beyond_it_is_as_near_as_the_windows_left_out_allow(kind: str) -> None:
    samples = np.random.default_rng(1).standard_normal(100_000)
    curve = octaves([samples], 1.0, kind)
    exact = exact_deviations(samples, curve.tau_s.astype(int), kind)
    apart = np.abs(curve.deviation / exact - 1) * np.sqrt(2 * curve.edf)  # in standard deviations
    assert len(apart) >= 15
    assert np.all(apart[:-2] < 0.2)


def test_bins_hold_the_phase_within_them() -> None:
    """Else the modified deviation would be that of a 32 times finer averaging only: 0.05 % too large."""
    samples = np.random.default_rng(1).standard_normal(100_000)
    curve = octaves([samples], 1.0, "modified")
    exact = exact_deviations(samples, curve.tau_s[6:10].astype(int), "modified")
    assert curve.deviation[6:10] == pytest.approx(exact, rel=1e-4)


@settings(max_examples=25, deadline=None)
@given(st.integers(2, 20_000), st.lists(st.integers(0, 20_000), max_size=6), st.integers(0, 99))
def test_deviations_do_not_depend_on_the_blocks(n: int, cuts: list[int], seed: int) -> None:
    samples = np.random.default_rng(seed).standard_normal(n)
    whole, parts = Octaves(1.0), Octaves(1.0)
    whole.add(samples)
    parts.add(samples[:1])
    for part in np.split(samples[1:], sorted(min(cut, n - 1) for cut in cuts)):
        parts.add(part)
    for kind in OCTAVE_KINDS:
        assert parts.curve(kind).deviation == pytest.approx(whole.curve(kind).deviation, rel=1e-9)


def test_a_curve_may_be_asked_for_on_the_way() -> None:
    samples = np.random.default_rng(1).standard_normal(9000)
    seen = Octaves(1.0)
    seen.add(samples[:5000])
    early = seen.curve()
    seen.add(samples[5000:])
    assert early.deviation == pytest.approx(octaves([samples[:5000]], 1.0).deviation)
    assert seen.curve().deviation == pytest.approx(octaves([samples], 1.0).deviation)


@pytest.mark.parametrize("kind", OCTAVE_KINDS)
def test_a_mean_of_20000_under_the_noise_costs_no_digits(kind: str) -> None:
    noise = np.round(np.random.default_rng(2).standard_normal(1 << 18) / GRID) * GRID  # the sum is exact
    plain, lifted = octaves([noise], 1.0, kind), octaves([20_000.0 + noise], 1.0, kind)
    assert lifted.deviation == pytest.approx(plain.deviation, rel=1e-9)
    assert lifted.alpha == plain.alpha


@pytest.mark.parametrize("kind", ["i2", "i4", "f4", ">f8"])
def test_samples_of_any_number_type_are_taken(kind: str) -> None:
    counts = np.rint(100 * np.random.default_rng(1).standard_normal(3000))
    assert octaves([counts.astype(kind)], 1.0).deviation == pytest.approx(octaves([counts], 1.0).deviation)


def test_the_windows_that_are_left_out_would_tell_nothing() -> None:
    """The variance over records, of ours and of every overlap."""
    random = np.random.default_rng(4)
    ours, all_of_them = [], []
    for _ in range(150):
        samples = random.standard_normal(4096)
        curve = octaves([samples], 1.0)
        ours.append(curve.deviation**2)
        all_of_them.append(exact_deviations(samples, curve.tau_s.astype(int)) ** 2)
    assert np.all(np.var(ours, axis=0) / np.var(all_of_them, axis=0) < 1.05)


@pytest.mark.parametrize("alpha", NOISES)
def test_the_type_of_the_noise_is_identified(alpha: int) -> None:
    made = [NOISES[alpha](np.random.default_rng(seed), 4096) for seed in range(20)]
    told = [noise_type(len(each), moments_of(each - each.mean())) for each in made]
    assert told.count(alpha) >= 18


def test_of_few_means_or_of_none_that_differ_no_type_is_told() -> None:
    assert noise_type(29, moments_of(np.random.default_rng(1).standard_normal(29))) is None
    assert noise_type(100, moments_of(np.ones(100))) is None


@pytest.mark.parametrize("alpha", [0, -1, -2])
@pytest.mark.parametrize("kind", ["overlapping", "modified", "hadamard", "total"])
def test_degrees_of_freedom_are_those_that_records_show(alpha: int, kind: str) -> None:
    """Twice the mean squared over the variance, over records; at a tenth of their length."""
    n, m = 640, 64
    random = np.random.default_rng(7)
    variances = np.array([exact_deviations(NOISES[alpha](random, n), [m], kind)[0] ** 2 for _ in range(400)])
    shown = 2 * variances.mean() ** 2 / variances.var()
    assert freedom(kind, alpha, n, m, overlap_of(m, alpha)) == pytest.approx(shown, rel=0.25)


def test_an_interval_holds_the_deviation_and_narrows() -> None:
    wide, narrow = interval(1.0, 3.0), interval(1.0, 300.0)
    assert wide[0] < narrow[0] < 1.0 < narrow[1] < wide[1]
    assert narrow == pytest.approx((1 - 1.96 / np.sqrt(600), 1 + 1.96 / np.sqrt(600)), rel=0.02)


def test_intervals_of_95_percent_cover() -> None:
    random, held = np.random.default_rng(9), []
    for _ in range(200):
        curve = octaves([random.standard_normal(2048)], 1.0)
        held.append((curve.low * np.sqrt(curve.tau_s) < 1) & (curve.high * np.sqrt(curve.tau_s) > 1))
    assert np.all((np.mean(held, axis=0)[:7] > 0.9) & (np.mean(held, axis=0)[:7] < 0.99))


def test_few_means_do_not_change_the_noise_type() -> None:
    """Of 36 means the type would be off in every tenth record, and the interval a third of what it should be."""
    records = [np.random.default_rng(seed).standard_normal(36_000) for seed in range(40)]
    told = [alpha for each in records for alpha in octaves([each], 10.0).alpha]
    assert set(told) == {0}
