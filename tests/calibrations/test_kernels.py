"""The compiled loops against plain references."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibrations.effects.kernels import slip
from calibrations.means.kernels import whiten, whiten_transposed
from calibrations.means.noise import Noise, rms, white_only
from calibrations.table import Array


def covariance(gap_s: Array, white: Array, slow: Sequence[float], taus_s: Sequence[float]) -> Array:
    """White noise plus Gauss-Markov processes, dense."""
    apart = np.abs(np.subtract.outer(np.cumsum(gap_s), np.cumsum(gap_s)))
    return np.diag(white**2) + sum(s**2 * np.exp(-apart / tau) for s, tau in zip(slow, taus_s, strict=True))


def test_slow_noise_leaves_few_independent_rows() -> None:
    rows = 240
    noise = Noise(
        np.ones((3, rows)), np.ones(rows), np.zeros(3), np.array([0.0, 100.0, 1.0]), ((1.0,), (10.0,), (10.0,))
    )
    white, slow, both = noise.effective_rows
    assert white == pytest.approx(rows)
    assert slow == pytest.approx(rows / 10.0, rel=0.1)  # the sum of exp(-2 |lag| / tau) over all lags
    assert slow < both < white


@given(
    st.integers(0, 10_000),
    st.lists(st.tuples(st.sampled_from([0.0, 0.1, 1.0, 30.0]), st.sampled_from([1.0, 100.0, 1e4])), max_size=3),
)
def test_whiten_is_the_dense_covariance(seed: int, processes: list[tuple[float, float]]) -> None:
    rng = np.random.default_rng(seed)
    gap_s, white = rng.uniform(0.1, 20, 40), rng.uniform(0.5, 2, 40)
    columns = rng.standard_normal((40, 3))
    slow, taus_s = np.array([s for s, _ in processes]), np.array([tau for _, tau in processes])
    out, logdet = whiten(columns, gap_s, white, slow, taus_s)
    sigma = covariance(gap_s, white, slow, taus_s)
    lower = np.linalg.cholesky(sigma)
    dense = np.linalg.solve(lower, columns)
    np.testing.assert_allclose(out, dense, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(out.T @ out, columns.T @ np.linalg.solve(sigma, columns), rtol=1e-9, atol=1e-9)
    assert logdet == pytest.approx(2 * np.sum(np.log(np.diag(lower))), rel=1e-9, abs=1e-9)
    transposed = np.linalg.solve(lower.T, columns)
    np.testing.assert_allclose(whiten_transposed(columns, gap_s, white, slow, taus_s), transposed, rtol=1e-9, atol=1e-9)


def test_noise_value_agrees_with_its_formula() -> None:
    """Sigma = W + k^2 I + (rho w)^2 G, channel by channel; flicker shares its level evenly among its processes."""
    rng = np.random.default_rng(3)
    gap_s, white = rng.uniform(1, 9, 25), rng.uniform(0.5, 2, (2, 25))
    taus_s = ((40.0,), (5.0, 30.0, 180.0))
    noise = Noise(white, gap_s, np.array([0.3, 0.0]), np.array([1.5, 0.7]), taus_s)
    columns = rng.standard_normal((2, 25, 2))
    gram, logdet = np.zeros((2, 2)), 0.0
    for c, (k, rho) in enumerate([(0.3, 1.5), (0.0, 0.7)]):
        w = np.sqrt(np.mean(white[c] ** 2 + k**2))
        each = [rho * w / np.sqrt(len(taus_s[c]))] * len(taus_s[c])
        sigma = covariance(gap_s, np.sqrt(white[c] ** 2 + k**2), each, taus_s[c])
        gram += columns[c].T @ np.linalg.solve(sigma, columns[c])
        logdet += np.linalg.slogdet(sigma)[1]
        assert noise.slow[c] == pytest.approx(rho * w)
    out = noise.whiten(columns)
    np.testing.assert_allclose(out.T @ out, gram, rtol=1e-9)
    assert noise.logdet == pytest.approx(logdet, rel=1e-9)
    np.testing.assert_allclose(noise.floor, rms(white))
    np.testing.assert_array_equal(noise.tau_s, [40.0, 180.0])


def test_floor_is_the_scatter_where_white_noise_is_not_known() -> None:
    noise = white_only(None, np.ones(5), 2)
    assert not noise.known
    np.testing.assert_array_equal(noise.floor, [1.0, 1.0])
    np.testing.assert_array_equal(noise.slow, [0.0, 0.0])


def play(way: Array, limit: float) -> float:
    """Krasnosel'skii's play operator: what the input drags behind it, `limit` to either side."""
    state = 0.0
    for u in way:
        state = max(u - limit, min(u + limit, state))
    return state


@given(st.integers(0, 10_000))
def test_elements_that_slip_hold_what_a_play_leaves(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, turns = 15, 4
    a, on_the_way = rng.uniform(-1, 1, (n, 3)), rng.uniform(-1, 1, (n, turns, 3))
    limits = rng.uniform(0.05, 0.5, (6, 3))
    found = slip(a, on_the_way, np.ones((n, 3)), limits, np.zeros(3))
    way = np.concatenate([on_the_way, a[:, None]], axis=1)
    for i, k in np.ndindex(n, 3):
        u = way[: i + 1, :, k].ravel()
        held = sum(u[-1] - play(u, limit) for limit in limits[:, k])
        assert found[i, k] == pytest.approx(held / limits[:, k].sum(), abs=1e-12)


def test_pressing_widens_the_limits() -> None:
    a = np.array([[0.1, 0.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    pressed = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.5, 1.0, 1.0]])
    found = slip(a, np.repeat(a[:, None], 2, axis=1), pressed, np.full((1, 3), 0.2), np.zeros(3))
    np.testing.assert_allclose(found[:, 0], [0.5, 1.0, -1.5])
    np.testing.assert_array_equal(found[:, 1:], 0.0)


def test_an_element_forgets_its_first_state_where_it_slips() -> None:
    a = np.zeros((4, 3))
    a[:, 0] = [0.1, -0.1, 0.3, -0.3]
    begun = np.array([-1.0, 0.0, 0.0])
    from_below, from_rest = (
        slip(a, np.empty((4, 0, 3)), np.ones((4, 3)), np.full((1, 3), 0.2), each)[:, 0] for each in (begun, np.zeros(3))
    )
    np.testing.assert_allclose(from_below, [-0.5, -1.0, 1.0, -1.0])
    np.testing.assert_allclose(from_rest, [0.5, -0.5, 1.0, -1.0])
