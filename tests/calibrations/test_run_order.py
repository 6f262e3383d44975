"""Orders of a few poses, against all orders that there are."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from calibrations.design.run_order import Order, Tour, order_tour
from calibrations.table import Array


def line(places: Array, dwell_s: float = 0.0) -> Tour:
    """Poses along a line, a second for each unit of way, of a sensor with bias and scale."""
    rows = np.column_stack([np.ones(len(places)), places])[:, None, :]
    return Tour(np.abs(places), np.abs(places[:, None] - places[None]), rows, dwell_s)


def least_s(tour: Tour) -> float:
    return min(tour.cost_s(np.array(order)) for order in permutations(range(len(tour.start_s))))


def correlated(x: Array, order: Order) -> float:
    """Squared multiple correlation of `x` with a parabola in time."""
    t = np.linspace(-1, 1, len(x))
    T = np.column_stack([np.ones_like(t), t, t**2])
    y = x[order]
    left = y - T @ np.linalg.lstsq(T, y, rcond=None)[0]
    return float(1 - np.sum(left**2) / np.sum((y - y.mean()) ** 2))


def test_without_a_drift_the_shortest_way_is_found() -> None:
    rng = np.random.default_rng(1)
    places = rng.permutation(np.arange(1.0, 21.0))
    tour = line(places)
    order = order_tour(tour)
    assert list(places[order]) == list(range(1, 21))
    assert tour.travel_s(order) == 20


def test_a_way_that_is_not_the_same_back_is_taken_the_right_way() -> None:
    rng = np.random.default_rng(2)
    move_s = rng.uniform(1, 5, (7, 7))
    tour = Tour(rng.uniform(1, 5, 7), move_s, np.zeros((7, 2, 1)), 0.0)
    assert tour.cost_s(order_tour(tour)) == pytest.approx(least_s(tour))


def test_the_loss_is_the_growth_of_the_variance_with_a_drift_beside() -> None:
    places = np.linspace(-1, 1, 20)
    tour = line(places)
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(20)
        share = correlated(places, order)
        assert tour.drift_loss(order) >= share / (1 - share) - 1e-9
    assert tour.drift_loss(np.arange(20)) == float("inf")  # height follows time: nothing tells scale from drift


def test_poses_that_no_fit_sees_suffer_no_drift() -> None:
    tour = Tour(np.zeros(9), np.zeros((9, 9)), np.zeros((9, 2, 3)), 100.0)
    assert tour.drift_loss(np.arange(9)) == 0


def test_a_long_dwell_is_worth_a_longer_way() -> None:
    places = np.linspace(-1, 1, 6)
    short, long = line(places, 0.1), line(places, 1000.0)
    assert long.cost_s(order_tour(long)) == pytest.approx(least_s(long), rel=0.2)  # annealing promises no more
    assert correlated(places, order_tour(long)) < 0.3 < correlated(places, order_tour(short))


def test_the_same_tour_has_the_same_order() -> None:
    tour = line(np.random.default_rng(3).normal(size=12), 50.0)
    assert np.array_equal(order_tour(tour), order_tour(tour))
