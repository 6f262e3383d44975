"""Designs against those that the textbooks derive, and the properties that an optimal one must have."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from calibrations.design.optimal_design import (
    Chosen,
    Criterion,
    DOptimal,
    IOptimal,
    choose_repeats,
    exchange_design,
    farthest_poses,
    scale_rows,
)
from calibrations.table import Array

X = np.linspace(-1, 1, 21)


def polynomial(degree: int) -> Array:
    """One output, rows 1, x, .., x^degree at X, shape (21, 1, degree + 1)."""
    return np.vander(X, degree + 1, increasing=True)[:, None, :]


def counts(chosen: Chosen) -> dict[float, int]:
    return {float(x): n for x, n in sorted(Counter(np.round(X[chosen], 9)).items())}


@pytest.mark.parametrize("criterion", [DOptimal(), IOptimal.over(polynomial(1))])
def test_a_line_is_measured_at_its_ends(criterion: Criterion) -> None:
    assert counts(exchange_design(polynomial(1), 8, criterion)) == {-1: 4, 1: 4}


def test_a_parabola_is_measured_at_ends_and_middle_alike_for_its_parameters() -> None:
    assert counts(exchange_design(polynomial(2), 12, DOptimal())) == {-1: 4, 0: 4, 1: 4}  # Fedorov (1972)


def test_and_twice_as_often_in_the_middle_for_its_predictions() -> None:
    found = counts(exchange_design(polynomial(2), 12, IOptimal.over(polynomial(2))))
    assert found == {-1: 3, 0: 6, 1: 3}  # Atkinson, Donev and Tobias (2007), V-optimum


def test_a_cubic_s_inner_points_are_where_theory_has_them() -> None:
    found = counts(exchange_design(polynomial(3), 16, DOptimal()))
    assert set(found) == {-1, -0.5, -0.4, 0.4, 0.5, 1}  # 1 / sqrt 5 lies between two places of the grid
    assert [found[-1], found[-0.5] + found[-0.4], found[0.4] + found[0.5], found[1]] == [4, 4, 4, 4]


def test_the_greatest_prediction_variance_is_that_of_the_parameters_number() -> None:
    """The equivalence theorem of Kiefer and Wolfowitz: n max f' C f = p at a D-optimum."""
    rows = scale_rows(np.random.default_rng(5).normal(size=(60, 2, 5)))
    chosen = exchange_design(rows, 200, DOptimal())
    covariance = np.linalg.inv(np.einsum("iap,iaq->pq", rows[chosen], rows[chosen]))
    variance = 200 * np.einsum("iap,pq,iaq->i", rows, covariance, rows)
    assert variance.max() == pytest.approx(5, rel=0.06)
    assert variance[np.unique(chosen)].min() > 4.5


def test_no_exchange_of_two_poses_helps() -> None:
    rows = scale_rows(np.random.default_rng(6).normal(size=(12, 2, 4)))
    criterion = IOptimal.over(rows)
    chosen = exchange_design(rows, 6, criterion)

    def loss(numbers: Chosen) -> float:
        return criterion.loss(np.linalg.inv(np.einsum("iap,iaq->pq", rows[numbers], rows[numbers])))

    for place in range(6):
        for other in range(12):
            tried = chosen.copy()
            tried[place] = other
            assert loss(tried) >= loss(chosen) * (1 - 1e-5)


def test_the_same_question_has_the_same_answer() -> None:
    first, second = (exchange_design(polynomial(3), 10, DOptimal()) for _ in range(2))
    assert np.array_equal(first, second)


def test_a_design_does_not_depend_on_units() -> None:
    in_other_units = scale_rows(polynomial(2) * np.array([1.0, 1e6, 1e-9]))
    assert np.allclose(in_other_units, scale_rows(polynomial(2)))


def test_what_cannot_be_told_is_no_obstacle() -> None:
    rows = np.concatenate([polynomial(1), polynomial(1)[:, :, :1] * 0, polynomial(1)[:, :, :1]], axis=2)
    assert set(counts(exchange_design(scale_rows(rows), 8, DOptimal()))) == {-1, 1}


def test_what_is_measured_again_is_each_another_pose_of_the_design() -> None:
    chosen = np.array([0, 0, 10, 20])
    more = choose_repeats(polynomial(2), chosen, 2, DOptimal())
    assert set(more) == {10, 20}  # they are there once so far
    assert sorted(choose_repeats(polynomial(2), chosen, 9, DOptimal())) == [0, 10, 20]


def test_check_poses_are_far_from_all() -> None:
    assert [float(X[k]) for k in farthest_poses(X[:, None], np.array([0, 20]), 3)] == pytest.approx([0, -0.5, 0.5])
