"""Least squares and the Kalman filter: against each other, against numpy, and against a published example."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from calibrations.errors import TooFewRows
from calibrations.estimators.kalman import Belief, Correction, correct, predict
from calibrations.estimators.least_squares import Recursive, least_squares
from calibrations.table import Array

ALMOST = 1e-10


def problem(seed: int, m: int = 40, n: int = 4) -> tuple[Array, Array, Array]:
    """Matrix, measurements and variances; columns of very different size."""
    random = np.random.default_rng(seed)
    matrix = random.standard_normal((m, n)) * 10.0 ** np.arange(n)
    variances = 10 ** random.uniform(-2, 2, m)
    return matrix, matrix @ random.standard_normal(n) + np.sqrt(variances) * random.standard_normal(m), variances


def by_normal_equations(matrix: Array, measured: Array, weights: Array) -> Array:
    """Book (18.8), weighted, as it is printed."""
    return np.asarray(np.linalg.inv(matrix.T @ (weights[:, None] * matrix)) @ matrix.T @ (weights * measured))


@pytest.mark.parametrize("seed", range(10))
def test_least_squares_is_the_books_formula(seed: int) -> None:
    matrix, measured, variances = problem(seed)
    found = least_squares(matrix, measured, variances)
    np.testing.assert_allclose(found.values, by_normal_equations(matrix, measured, 1 / variances), rtol=1e-7)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(matrix.T @ (matrix / variances[:, None])), rtol=1e-7)
    left = (measured - matrix @ found.values) / np.sqrt(variances)
    assert found.square == pytest.approx(left @ left)


def test_the_weighted_standard_errors_are_true() -> None:
    z = []
    for seed in range(400):
        random = np.random.default_rng(seed)
        matrix, _, variances = problem(1)
        found = least_squares(matrix, np.sqrt(variances) * random.standard_normal(40), variances)
        z.append(found.values / np.sqrt(np.diag(found.covariance)))
    assert kstest(np.ravel(z), "norm").pvalue > 0.001


def test_it_holds_where_the_normal_equations_fail() -> None:
    """Columns that differ in the ninth digit: their square is beyond double precision."""
    t = np.linspace(0, 1, 30)
    matrix = np.column_stack([np.ones(30), 1 + 1e-9 * t])
    found = least_squares(matrix, matrix @ [3.0, -2.0])
    assert found.values == pytest.approx([3.0, -2.0], abs=1e-5)
    assert abs(by_normal_equations(matrix, matrix @ [3.0, -2.0], np.ones(30)) - [3.0, -2.0]).max() > 0.1


@pytest.mark.parametrize("seed", range(20))
def test_one_after_another_is_all_at_once(seed: int) -> None:
    matrix, measured, variances = problem(seed)
    known = Recursive.of(4)
    for k, (row, value, variance) in enumerate(zip(matrix, measured, variances, strict=True), 1):
        known = known.after(row, value, variance)
        if k in (5, 17, 40):
            found, batch = known.estimate(), least_squares(matrix[:k], measured[:k], variances[:k])
            np.testing.assert_allclose(found.values, batch.values, rtol=ALMOST)
            np.testing.assert_allclose(found.covariance, batch.covariance, rtol=ALMOST, atol=1e-14)
            assert found.square == pytest.approx(batch.square, rel=1e-9)


def test_what_the_measurements_do_not_tell_is_left_open_and_the_rest_is_told() -> None:
    """A second and a third unknown of which only the sum is measured; a fourth that is not touched."""
    random = np.random.default_rng(2)
    known = Recursive.of(4)
    for _ in range(30):
        row = np.array([random.standard_normal(), 1.0, 1.0, 0.0])
        known = known.after(row, float(row @ [5.0, 1.0, 2.0, 7.0]) + 0.1 * random.standard_normal())
    found = known.estimate()
    assert found.values[0] == pytest.approx(5.0, abs=4 * found.scattered[0])
    assert np.isnan(found.values[1:]).all()
    assert np.isnan(found.scattered[1:]).all()
    assert found.freedom == 28
    told = known.after(np.array([0.0, 1.0, 0.0, 0.0]), 1.0).estimate()
    assert told.values[:3] == pytest.approx([5.0, 1.0, 2.0], abs=0.2)


def test_standard_errors_of_scatter_are_true() -> None:
    z = []
    for seed in range(300):
        random = np.random.default_rng(seed)
        known = Recursive.of(2)
        for row in random.standard_normal((60, 2)):
            known = known.after(row, 3.0 * random.standard_normal())
        found = known.estimate()
        z.append(found.values / found.scattered)
    assert np.std(z) == pytest.approx(1.0, abs=0.1)


def test_too_few_measurements_are_refused() -> None:
    known = Recursive.of(3).after(np.array([1.0, 0, 0]), 1.0).after(np.array([0, 1.0, 0]), 1.0)
    assert known.estimate().values == pytest.approx([1.0, 1.0, np.nan], nan_ok=True)
    assert np.isnan(known.estimate().scattered).all()
    with pytest.raises(TooFewRows, match="2 unknowns"):
        least_squares(np.ones((5, 2)), np.ones(5))


# A building's height, guessed at 60 m (std 15 m), measured ten times by an altimeter of 5 m.
# A. Becker, Kalman Filter from the Ground Up (2023), and kalmanfilter.net, "Estimating the height of a building".
HEIGHTS_M = (48.54, 47.11, 55.01, 55.15, 49.89, 40.85, 46.72, 50.05, 51.27, 49.95)
PUBLISHED = ((49.69, 22.5), (48.47, 11.84), (50.57, 8.04), (51.68, 6.08), (51.33, 4.89), (49.62, 4.09),
             (49.21, 3.52), (49.31, 3.08), (49.53, 2.74), (49.57, 2.47))  # fmt: skip


def test_a_kalman_filter_gives_the_numbers_of_a_published_example() -> None:
    belief, one = Belief(np.array([60.0]), np.array([[225.0]])), np.eye(1)
    for measured, (mean, variance) in zip(HEIGHTS_M, PUBLISHED, strict=True):
        belief = correct(predict(belief, one, 0 * one), np.array([measured]), one, 25.0 * one).belief
        assert belief.mean[0] == pytest.approx(mean, abs=0.006)
        assert belief.covariance[0, 0] == pytest.approx(variance, abs=0.006)


# A body that is nudged at random: position and speed, of which the position is measured.
STEP = np.array([[1.0, 1.0], [0.0, 1.0]])
NUDGES = 0.04 * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
SEEN, NOISE = np.array([[1.0, 0.0]]), np.array([[2.0]])
START = Belief(np.zeros(2), np.diag([100.0, 4.0]))


def walked(seed: int, steps: int, nudges: Array = NUDGES) -> tuple[Array, Array]:
    """True states (steps, 2) and measurements (steps, 1)."""
    random = np.random.default_rng(seed)
    state, states = random.multivariate_normal(START.mean, START.covariance), []
    for _ in range(steps):
        state = STEP @ state + random.multivariate_normal(np.zeros(2), nudges)
        states.append(state)
    return np.array(states), np.array(states) @ SEEN.T + np.sqrt(2.0) * random.standard_normal((steps, 1))


def filtered(measured: Array) -> list[Correction]:
    belief, corrections = START, []
    for z in measured:
        corrections.append(correct(predict(belief, STEP, NUDGES), z, SEEN, NOISE))
        belief = corrections[-1].belief
    return corrections


def at_once(measured: Array) -> Belief:
    """The last state from all measurements by their joint normal distribution, without any recursion."""
    n, powers = len(measured), [np.linalg.matrix_power(STEP, k) for k in range(len(measured) + 1)]
    states = np.zeros((n, n, 2, 2))
    for i in range(n):
        for j in range(n):
            start = powers[i + 1] @ START.covariance @ powers[j + 1].T
            states[i, j] = start + sum(powers[i - k] @ NUDGES @ powers[j - k].T for k in range(min(i, j) + 1))
    whole = states.transpose(0, 2, 1, 3).reshape(2 * n, 2 * n)
    H = np.kron(np.eye(n), SEEN)
    gain = whole[-2:] @ H.T @ np.linalg.inv(H @ whole @ H.T + 2.0 * np.eye(n))
    return Belief(gain @ measured[:, 0], whole[-2:, -2:] - gain @ H @ whole[:, -2:])


@pytest.mark.parametrize("seed", range(5))
def test_the_filter_ends_where_all_measurements_at_once_do(seed: int) -> None:
    _, measured = walked(seed, 15)
    end = filtered(measured)[-1].belief
    np.testing.assert_allclose(end.mean, at_once(measured).mean, rtol=1e-9)
    np.testing.assert_allclose(end.covariance, at_once(measured).covariance, rtol=1e-9)


def test_innovations_tell_whether_the_model_holds() -> None:
    holds = [chi2.sf(sum(float(each.nis) for each in filtered(walked(seed, 50)[1])), 50) for seed in range(100)]
    assert kstest(holds, "uniform").pvalue > 0.001
    wrong = [sum(float(each.nis) for each in filtered(walked(seed, 50, 30 * NUDGES)[1])) for seed in range(20)]
    assert np.median(wrong) > chi2.isf(1e-3, 50)


def test_the_covariance_stays_positive_where_the_plain_form_does_not() -> None:
    """Bierman's example: what is hardly known is measured in nearly one direction, then in another."""
    small = 1.3e-9
    rows = np.array([[1.0, small], [1.0, 1.0]])
    belief, plain = Belief(np.zeros(2), np.eye(2) / small**2), np.eye(2) / small**2
    for row in rows[:, None]:
        gain = plain @ row.T / (row @ plain @ row.T + 1.0)
        plain = plain - gain @ row @ plain
        belief = correct(belief, np.zeros(1), row, np.eye(1)).belief
    whole = least_squares(np.vstack([small * np.eye(2), rows]), np.zeros(4)).covariance
    np.testing.assert_allclose(belief.covariance, whole, rtol=1e-9)
    assert abs(plain / whole - 1).max() > 1
