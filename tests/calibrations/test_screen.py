"""Score tests: the statistic is the full least-squares reduction, and chances are true on noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

from calibrations.criteria import NOT_SHOWN
from calibrations.discovery.candidates import chance_of_gain
from calibrations.discovery.significance import Screen, Search, of_search, reductions
from calibrations.fitting.fit import Fit, fit
from calibrations.means.noise import Noise
from calibrations.model.file import read_model
from calibrations.table import Array
from tests.calibrations import synthetic
from tests.calibrations.test_kernels import covariance


@pytest.fixture(scope="module")
def fitted() -> Fit:
    """A linear model on a small sweep, under white and slow noise."""
    columns = synthetic.turns((90, 30), step_deg=20)
    a_x, a_y, _ = synthetic.components(columns)
    found = fit(read_model("linear"), synthetic.poses(columns, a_x + 2.5, a_y + 2.5))
    slow = Noise(found.noise.white, found.noise.gap_s, np.zeros(2), np.array([0.7, 0.3]), ((60.0,), (20.0, 90.0)))
    return replace(found, noise=slow)


def reduction(found: Fit, columns: Array) -> float:
    """What the sum of squares falls by, from two dense least-squares solutions."""
    white = found.noise.whiten(np.concatenate([found.residual[:, :, None], found.jacobian, columns], axis=2))
    r, J, both = white[:, 0], white[:, 1:5], white[:, 1:]

    def left(X: Array) -> float:
        Q, _ = np.linalg.qr(X / np.linalg.norm(X, axis=0))
        error = r - Q @ (Q.T @ r)
        return float(error @ error)

    return left(J) - left(both)


@pytest.mark.parametrize("apart", [1.0, 0.3, 2 * NOT_SHOWN])
@pytest.mark.parametrize("seed", range(5))
def test_statistic_is_the_full_reduction(fitted: Fit, apart: float, seed: int) -> None:
    """Frisch, Waugh and Lovell; also where columns are nearly those of the model, and nearly each other."""
    rng = np.random.default_rng(seed)
    free = rng.standard_normal((*fitted.residual.shape, 3))
    size = np.linalg.norm(fitted.jacobian.reshape(-1, 4), axis=0)
    mixed = (fitted.jacobian / size) @ rng.standard_normal((4, 3)) * np.sqrt(fitted.residual.size) + apart * free
    mixed[:, :, 2] = mixed[:, :, 1] + 1e-4 * free[:, :, 2]
    screen = Screen(fitted)
    basis = screen.basis(mixed)
    assert basis.shape[1] == 3
    np.testing.assert_allclose(basis.T @ basis, np.eye(3), atol=1e-12)
    assert screen.statistic(basis) == pytest.approx(reduction(fitted, mixed), rel=1e-9, abs=1e-9)


def test_bases_of_many_groups_are_those_of_each_alone(fitted: Fit) -> None:
    """Groups of several widths; one has a column of zeros, one has twice the same, one has a column of the model."""
    rng = np.random.default_rng(6)
    groups = [rng.standard_normal((*fitted.residual.shape, 1 + i % 3)) for i in range(40)]
    groups[4][:, :, 0] = 0.0
    groups[8][:, :, 2] = groups[8][:, :, 1]
    groups[11][:, :, 0] = fitted.jacobian[:, :, 0]
    screen = Screen(fitted)
    alone = [screen.basis(group) for group in groups]
    assert [alone[i].shape[1] for i in (4, 8, 11)] == [1, 2, 2]
    for together, basis in zip(screen.bases(groups), alone, strict=True):
        np.testing.assert_allclose(together @ together.T, basis @ basis.T, atol=1e-12)
    assert screen.bases([]) == []


def test_what_the_model_has_adds_nothing(fitted: Fit) -> None:
    again = fitted.jacobian @ np.random.default_rng(0).standard_normal((4, 2))
    assert Screen(fitted).basis(again).shape[1] == 0
    assert Search(Screen(fitted), []).trials == 1.0


def drawn(found: Fit, rng: np.random.Generator) -> Fit:
    """The same fit with a residual drawn from its noise, the model freed from it."""
    residual = np.empty_like(found.residual)
    for c, (slow, taus) in enumerate(zip(found.noise.slow, found.noise.taus_s, strict=True)):
        sigma = covariance(found.noise.gap_s, found.noise.fast[c], [slow / np.sqrt(len(taus))] * len(taus), taus)
        residual[c] = np.linalg.cholesky(sigma) @ rng.standard_normal(len(sigma))
    return replace(found, residual=residual)


def test_chances_are_uniform_on_noise(fitted: Fit) -> None:
    """Each alone, and the best of a search whose columns are correlated with each other."""
    rng = np.random.default_rng(5)
    common = rng.standard_normal((*fitted.residual.shape, 2))
    bases = [Screen(fitted).basis(common + rng.standard_normal(common.shape)[:, :, : 1 + k % 2]) for k in range(8)]
    trials = Search(Screen(fitted), bases).trials
    assert 1 < trials < 8.5
    alone, best = [], []
    for _ in range(300):
        search = Search(Screen(drawn(fitted, rng)), bases)
        search.__dict__["trials"] = trials  # the same for the same bases
        best.append(search.p_values.min())
        alone.append(Search(search.screen, bases[:1]).statistics[0])
    assert kstest(best, "uniform").pvalue > 0.01
    assert kstest(alone, "chi2", args=(bases[0].shape[1],)).pvalue > 0.01


def test_of_search_is_exact_for_small_chances() -> None:
    assert of_search(1e-20, 5.0) == pytest.approx(5e-20, rel=1e-12)
    assert of_search(0.5, 2.0) == pytest.approx(0.75)
    assert of_search(1.0, 3.0) == pytest.approx(1.0)


@pytest.mark.parametrize("cosine", [0.0, 0.9, 1 - 1e-5, 1 - 1e-10])
@pytest.mark.parametrize("like", ["model", "another"])
def test_reductions_are_those_of_a_least_squares_solve_each(cosine: float, like: str) -> None:
    rng = np.random.default_rng(17)
    rows, sine = 5000, np.sqrt(1 - cosine**2)
    model = np.linalg.qr(rng.standard_normal((rows, 6)))[0] * 10.0 ** rng.uniform(-3, 3, 6)
    candidates = [rng.standard_normal((rows, 1 + k % 3)) for k in range(25)]
    for columns in candidates:
        near = model[:, 2] if like == "model" or columns.shape[1] == 1 else columns[:, 0]
        columns[:, -1] = cosine * near / np.linalg.norm(near) + sine * columns[:, -1] / np.linalg.norm(columns[:, -1])
    signal = sum(c[:, -1] / max(sine, 1e-6) for c in candidates)
    residual = model @ rng.standard_normal(6) + signal + 0.02 * rng.standard_normal(rows)
    by_solving = [left(model, residual) - left(np.hstack([model, columns]), residual) for columns in candidates]
    rounding = 1e-13 * left(model, residual)  # of the two sums of squares whose difference it is
    np.testing.assert_allclose(reductions(model, residual, candidates), by_solving, rtol=1e-9, atol=rounding)


def left(columns: Array, residual: Array) -> float:
    """Sum of squares beside `columns`."""
    scaled = columns / np.linalg.norm(columns, axis=0)
    return float(np.sum((residual - scaled @ np.linalg.lstsq(scaled, residual)[0]) ** 2))


def test_a_candidate_that_the_model_holds_reduces_nothing() -> None:
    rng = np.random.default_rng(18)
    model, residual = rng.standard_normal((200, 3)), rng.standard_normal(200)
    held = model @ rng.standard_normal((3, 2))
    assert reductions(model, residual, [held, np.zeros((200, 1))]) == pytest.approx([0.0, 0.0], abs=1e-12)
    assert len(reductions(model, residual, [])) == 0


def test_a_repeated_column_counts_once(fitted: Fit) -> None:
    column = np.random.default_rng(19).standard_normal((*fitted.residual.shape, 1))
    assert Screen(fitted).basis(np.concatenate([column, 2 * column], axis=2)).shape[1] == 1


def test_chance_of_a_loss_or_of_no_gain_is_one() -> None:
    assert [chance_of_gain(gain, 108, rank=17, free=50) for gain in (-40.0, -1e-12, 0.0)] == [1.0, 1.0, 1.0]
    assert chance_of_gain(1e-6, 108, rank=17, free=50) == pytest.approx(1.0)
    assert chance_of_gain(400.0, 108, rank=17, free=50) < 1e-9
