"""Spectra of the processes against records that were made without them; the transform; the sums kept of a record."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from calibrations.noise.comparison import line_variance, quadrature
from calibrations.noise.deviations import deviations
from calibrations.spectrum import (
    LENGTH,
    MOST_MEANS,
    Means,
    Sampling,
    Welch,
    fast_bands,
    flickering,
    gauss_markov,
    random_walk,
    slow_bands,
)
from tests.calibrations import noises

N, RECORDS = 2048, 60
MADE: dict[str, Callable[[np.random.Generator, int], np.ndarray]] = {
    "white-noise": lambda random, n: random.standard_normal(n),
    "flicker-noise": noises.flicker,
    "rate-random-walk": noises.random_walk,
    "quantisation-noise": noises.quantisation,
    "gauss-markov-noise": lambda random, n: noises.gauss_markov(random, n, 30.0),
}


def means_of(samples: np.ndarray, size: int) -> np.ndarray:
    means = samples.reshape(-1, size).mean(axis=1)
    return means - means.mean()


@pytest.mark.parametrize("size", [1, 2, 5])
@pytest.mark.parametrize("name", MADE)
def test_the_cosine_transform_of_means_has_the_spectrum(name: str, size: int) -> None:
    """Bands of many records, 1 / 10 s a sample; also where folded parts matter."""
    random = np.random.default_rng(1)
    sampling = Sampling(0.1, size)
    bands = [slow_bands(means_of(MADE[name](random, size * N), size), sampling) for _ in range(RECORDS)]
    ratio = np.mean([each.density for each in bands], axis=0) / bands[0].column(name, 300.0)
    ratio /= {"white-noise": 10.0, "flicker-noise": 1.0, "rate-random-walk": 0.1, "quantisation-noise": 100.0}.get(
        name, 1.0
    )
    assert np.all(np.abs(ratio - 1)[:] < 4.5 * np.sqrt(2 / bands[0].freedom / RECORDS) + 0.03)


def test_bins_of_one_sample_are_samples() -> None:
    f = np.linspace(0.01, 0.5, 50)
    assert random_walk(f, Sampling(1.0)) == pytest.approx(1 / (4 * np.sin(np.pi * f) ** 2))
    a = np.exp(-1 / 7)
    expected = (1 - a**2) / (1 - 2 * a * np.cos(2 * np.pi * f) + a**2)
    assert gauss_markov(f, Sampling(1.0), 7.0) == pytest.approx(expected)


def test_a_long_time_constant_is_a_random_walk() -> None:
    f, slow = np.linspace(0.01, 0.5, 50), 1e7
    for size in (1, 16):
        by = Sampling(1.0, size)
        assert gauss_markov(f / size, by, slow) * slow / 2 == pytest.approx(random_walk(f / size, by), rel=1e-3)


def test_the_first_coefficients_of_flicker_noise() -> None:
    """Against the double integral of its generalised covariance -2 log |s - t| with the cosines, on a grid."""
    n = 400
    t = (np.arange(n) + 0.5) / n
    apart = np.abs(t[:, None] - t) + np.eye(n) * np.exp(-1) / (2 * n)  # the mean logarithm within a cell
    for k in (1, 2, 3, 8):
        wave = np.sqrt(2) * np.cos(np.pi * k * t)
        variance = wave @ (-2 * np.log(apart)) @ wave / n**2
        assert variance / (2 / k) == pytest.approx(flickering(np.array([float(k)]))[0], rel=0.02)
    bands = slow_bands(np.random.default_rng(1).standard_normal(1000), Sampling(1.0))
    assert bands.column("flicker-noise")[0] == pytest.approx(0.774 / (2 * np.pi / 2000), rel=1e-3)


@pytest.mark.parametrize("name", MADE)
def test_allan_variances_are_those_of_the_processes(name: str) -> None:
    """At one sample too, where a Gauss-Markov process is not what it is in continuous time."""
    steps = [1, 2, 16, 64]
    records = [MADE[name](np.random.default_rng(seed), 1 << 14) for seed in range(20)]
    shown = np.mean([deviations(each, steps) ** 2 for each in records], axis=0)
    asked = [quadrature(m, 1.0, np.inf) for m in steps]
    assert shown == pytest.approx([w @ at.column(name, 30.0) for at, w in asked], rel=0.12)


@pytest.mark.parametrize(
    ("name", "continuous"),
    [
        ("white-noise", lambda tau_s: 1 / tau_s),
        ("flicker-noise", lambda tau_s: 2 * np.log(2) / np.pi),
        ("rate-random-walk", lambda tau_s: tau_s / 3),
        ("quantisation-noise", lambda tau_s: 3 / tau_s**2),
    ],
)
def test_at_long_times_they_are_those_of_the_standard(name: str, continuous: Callable[[float], float]) -> None:
    """IEEE 952, annex C."""
    at, weights = quadrature(500, 1.0, np.inf)
    assert weights @ at.column(name) == pytest.approx(continuous(500.0), rel=0.01)


def test_allan_variance_of_a_sinusoid() -> None:
    wave = noises.sinusoid(1 << 14, 0.01)
    assert deviations(wave, [1, 16, 40]) ** 2 == pytest.approx(
        line_variance(0.01, np.array([1.0, 16.0, 40.0])), rel=0.02
    )


def test_means_take_twice_as_many_samples_when_they_are_full() -> None:
    samples = 1e6 + np.random.default_rng(1).standard_normal(2 * MOST_MEANS + 4097)
    seen = Means()
    for part in np.split(samples, [5, 1000, 150_000, 150_001]):
        seen.add(part)
    assert seen.size == 4
    expected = samples[: len(samples) // 4 * 4].reshape(-1, 4).mean(axis=1)
    assert seen.values() == pytest.approx(expected - expected.mean(), abs=1e-8)


def test_short_stretches_have_the_density_whatever_the_blocks() -> None:
    samples = np.random.default_rng(1).standard_normal(40 * LENGTH)
    whole, parts = Welch(10.0), Welch(10.0)
    whole.add(samples)
    for part in np.split(samples, [1, 5000, 100_001]):
        parts.add(part)
    seen = whole.segments()
    f, density, freedom = seen.frequency_hz, seen.density, seen.freedom
    assert parts.segments().density == pytest.approx(density)
    assert density.mean() == pytest.approx(0.1, rel=0.01)
    assert freedom == pytest.approx(2 * density.mean() ** 2 / density.var(), rel=0.2)
    bands = fast_bands(f, density, freedom, 10.0, np.inf)
    assert np.mean(2 / bands.freedom) == pytest.approx(np.mean((bands.density / 0.1 - 1) ** 2), rel=0.5)


def test_above_half_the_corner_of_a_filter_nothing_is_used() -> None:
    means = np.random.default_rng(1).standard_normal(4000)
    bands = slow_bands(means, Sampling(100.0), corner_hz=10.0)
    assert 4.8 < bands.frequency_hz.max() <= 5.1
    assert bands.column("white-noise")[-1] == pytest.approx(0.8, rel=0.05)


@pytest.mark.parametrize("size", [1, 16, 32])
def test_white_noise_behind_a_filter_keeps_its_density_in_means(size: int) -> None:
    random, corner_hz, rate_hz = np.random.default_rng(3), 15.0, 1000.0
    filter_samples = rate_hz / (2 * np.pi * corner_hz)
    samples = noises.gauss_markov(random, 400_000, filter_samples) * np.sqrt(rate_hz / (2 * filter_samples))
    means = samples.reshape(-1, size).mean(axis=1)
    bands = slow_bands(means - means.mean(), Sampling(rate_hz, size), corner_hz)
    ratio = bands.density / bands.column("white-noise")
    fast = bands.frequency_hz > 3
    off = (np.average(ratio[fast], weights=bands.freedom[fast]) - 1) * np.sqrt(bands.freedom[fast].sum() / 2)
    assert abs(off) < 3
    slow = bands.frequency_hz < 1
    assert (2 * np.pi * bands.frequency_hz * bands.column("flicker-noise"))[slow][-1] == pytest.approx(1, rel=0.02)
