"""The noise of greatest restricted likelihood: levels come back, and a dense implementation agrees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import minimize

from calibrations.criteria import INSEPARABLE
from calibrations.fitting.noise_fit import FLICKER_PROCESSES, FLICKER_RATIOS, RATIOS, TIME_CONSTANTS, estimate, gains
from calibrations.means.noise import white_only
from calibrations.table import Array
from tests.calibrations import synthetic
from tests.calibrations.test_kernels import covariance

N, GAP_S = 300, 7.0
GAPS = np.full(N, GAP_S)
NONE = np.zeros((N, 0))


@pytest.mark.parametrize("known", [True, False], ids=["white known", "white unknown"])
@pytest.mark.parametrize(("slow", "tau_s"), [(0.5, 100.0), (1.0, 60.0), (1.5, 200.0)])
def test_level_of_slow_noise_comes_back(slow: float, tau_s: float, known: bool) -> None:
    found = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        residual = (rng.standard_normal(N) + synthetic.gauss_markov(rng, slow, tau_s, GAPS))[None]
        start = white_only(np.ones((1, N)) if known else None, GAPS, 1)
        found.append(estimate(start, residual, np.ones((1, N, 1)), NONE))
    together = [np.hypot(noise.slow[0], noise.fast[0, 0]) for noise in found]
    assert np.median(together) == pytest.approx(np.hypot(slow, 1.0), rel=0.15)
    if known:  # else what flickers fastest cannot be told from white
        assert np.median([noise.slow[0] for noise in found]) == pytest.approx(slow, rel=0.25)


@pytest.mark.parametrize("known", [True, False], ids=["white known", "white unknown"])
def test_white_noise_alone_has_little_slow(known: bool) -> None:
    slow = []
    for seed in range(20):
        residual = 3e-5 * np.random.default_rng(seed).standard_normal((2, N))
        noise = estimate(
            white_only(np.full((2, N), 3e-5) if known else None, GAPS, 2), residual, np.ones((2, N, 1)), NONE
        )
        np.testing.assert_allclose(np.sqrt(np.mean(noise.fast**2, axis=1)), 3e-5, rtol=0.2)
        slow.append(noise.slow / 3e-5)
    assert np.median(slow) <= 0.25  # the least step of the grid, or none


def test_scatter_beyond_the_white_noise() -> None:
    rng = np.random.default_rng(8)
    white = rng.uniform(0.5, 1.5, (1, N))
    residual = np.hypot(white, 2.0) * rng.standard_normal((1, N))
    noise = estimate(white_only(white, GAPS, 1), residual, np.ones((1, N, 1)), NONE)
    assert noise.scatter[0] == pytest.approx(2.0, rel=0.1)


def test_a_smooth_misfit_is_not_taken_for_slow_noise() -> None:
    rng = np.random.default_rng(9)
    angle = 2 * np.pi * np.arange(N) / 40
    misfit, smooth = 5 * np.cos(angle), np.column_stack([np.cos(angle), np.sin(angle)])
    residual = (rng.standard_normal(N) + misfit)[None]
    with_smooth = estimate(white_only(np.ones((1, N)), GAPS, 1), residual, np.ones((1, N, 1)), smooth)
    without = estimate(white_only(np.ones((1, N)), GAPS, 1), residual, np.ones((1, N, 1)), NONE)
    assert with_smooth.slow[0] + with_smooth.scatter[0] < 0.5
    assert without.slow[0] + without.scatter[0] > 2.0


@dataclass(frozen=True)
class Dense:
    """One point of the grid by dense matrices: restricted likelihood to choose it, likelihood for its deviance."""

    ratio: float
    taus_s: tuple[float, ...]
    scale: float
    restricted: float
    deviance: float


def dense_best(gaps: Array, X: Array, r: Array) -> Dense:
    """None, one process, or flicker; one of the first or last where the data cannot tell it from the best."""
    span, gap = gaps.sum(), np.median(gaps[1:])
    flicker = tuple(np.geomspace(gap / 2, span / 3, FLICKER_PROCESSES))
    cautious = [dense(gaps, X, r, ratio, flicker) for ratio in (0.0, *FLICKER_RATIOS)]
    singles = [
        dense(gaps, X, r, ratio, (tau,)) for tau in np.geomspace(3 * gap, span / 3, TIME_CONSTANTS) for ratio in RATIOS
    ]
    first, single = (min(points, key=lambda d: d.restricted) for points in (cautious, singles))
    return first if first.restricted < single.restricted + INSEPARABLE else single


def dense(gaps: Array, X: Array, r: Array, ratio: float, taus_s: tuple[float, ...]) -> Dense:
    n, p = X.shape
    sigma = covariance(gaps, np.ones(n), [ratio / np.sqrt(len(taus_s))] * len(taus_s), taus_s)
    W = np.linalg.inv(sigma)
    information = X.T @ W @ X
    error = r - X @ np.linalg.solve(information, X.T @ W @ r)
    scale = np.sqrt(error @ W @ error / (n - p))
    logdet = np.linalg.slogdet(sigma)[1]
    restricted = 2 * (n - p) * np.log(scale) + logdet + np.linalg.slogdet(information)[1]
    return Dense(ratio, taus_s, scale, restricted, logdet + 2 * n * np.log(scale) + error @ W @ error / scale**2)


@pytest.mark.parametrize("seed", range(8))
def test_the_likelihood_is_that_of_dense_matrices(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = 60
    gaps = rng.uniform(3, 12, n)
    J, extra, smooth = rng.standard_normal((n, 3)), rng.standard_normal((n, 2)), rng.standard_normal((n, 4))
    slow = synthetic.gauss_markov(rng, 1.2, 80.0, gaps)
    r = 0.3 * (rng.standard_normal(n) + slow) + 0.2 * extra[:, 0]
    start = white_only(None, gaps, 1)
    without, beside = dense_best(gaps, np.hstack([smooth, J]), r), dense_best(gaps, np.hstack([smooth, J, extra]), r)
    found = estimate(start, r[None], J[None], smooth)
    assert found.ratio[0] == without.ratio
    assert found.slow[0] == 0 or found.taus_s[0] == pytest.approx(without.taus_s)
    assert found.scatter[0] == pytest.approx(without.scale, rel=1e-8)
    twice = gains(start, r[None], J[None], [extra[None]], smooth)[0]
    assert twice == pytest.approx(max(0.0, without.deviance - beside.deviance), abs=1e-7)


@pytest.mark.parametrize("own", [0, 1, 2], ids=lambda own: f"{own} of each channel alone")
def test_levels_of_two_channels_with_parameters_in_common(own: int) -> None:
    """Too few rows for slow noise: the two levels alone, against a minimum over both by dense matrices."""
    rng = np.random.default_rng(6)
    n = 15
    J, r = rng.standard_normal((2, n, 5)), np.array([[1.0], [4.0]]) * rng.standard_normal((2, n))
    J[0, :, 5 - own :], J[1, :, 1 : 1 + own] = 0.0, 0.0

    def restricted(log_std: Array) -> float:
        w = np.repeat(np.exp(-log_std), n)
        X, y = J.reshape(-1, 5) * w[:, None], r.ravel() * w
        error = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
        return float(error @ error + 2 * n * log_std.sum() + np.linalg.slogdet(X.T @ X)[1])

    best = minimize(restricted, np.zeros(2), tol=1e-10).x
    noise = estimate(white_only(None, np.full(n, GAP_S), 2), r, J, np.zeros((n, 0)))
    np.testing.assert_allclose(noise.scatter, np.exp(best), rtol=1e-2)


def test_columns_that_the_model_already_has_gain_nothing() -> None:
    rng = np.random.default_rng(2)
    J, r = rng.standard_normal((1, N, 2)), rng.standard_normal((1, N))
    again = J @ rng.standard_normal((2, 2))
    assert gains(white_only(None, GAPS, 1), r, J, [again], NONE)[0] == 0.0
    assert gains(white_only(None, GAPS, 1), r, J, [J[:, :, :0]], NONE)[0] == 0.0


def test_what_rounding_leaves_is_no_gain_and_no_noise() -> None:
    """Of data without noise, what is left is rounding: no column may be sure of explaining it."""
    shape = np.sin(np.arange(N))[None, :, None]
    residual = 1e-15 * shape[:, :, 0] + 1e-17 * np.random.default_rng(3).standard_normal((1, N))
    jacobian = np.full((1, N, 1), 2.5)
    noise = estimate(white_only(None, GAPS, 1), residual, jacobian, NONE)
    np.testing.assert_allclose(noise.fast, 2.5e-12)
    assert gains(noise, residual, jacobian, [shape], NONE)[0] < INSEPARABLE
    known = white_only(np.full((1, N), 1e-17), GAPS, 1)  # who states the noise is believed
    assert gains(known, residual, jacobian, [shape], NONE)[0] > 1e3
