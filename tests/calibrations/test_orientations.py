"""The choice of the next orientation by hand, and its words."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.design.orientations import (
    ORIENTATIONS,
    directions_up,
    find_covered,
    is_informative,
    is_other_side,
    name_orientation,
    next_orientation,
    orientation_words,
    turn_words,
)
from calibrations.geometry.sphere import harmonics
from calibrations.table import Array


def chosen(count: int) -> Array:
    ups = np.zeros((0, 3))
    for _ in range(count):
        ups = np.vstack([ups, next_orientation(ups, ups[-1] if len(ups) else None).up])
    return ups


def variance(ups: Array) -> float:
    """Mean variance of the nine parameters in units of one position's."""
    rows = harmonics(ups, 2)
    return float(np.trace(np.linalg.inv(rows.T @ rows)) / 9)


def test_each_side_is_upward_once_before_edges_and_corners() -> None:
    first = chosen(6)
    assert sorted(map(orientation_words, first)) == sorted(f"{sign}{axis} side up" for sign in "+-" for axis in "xyz")
    assert np.sum(np.abs(next_orientation(first, first[-1]).up) > 0.1) > 1


def test_the_choice_is_better_than_random_orientations_and_near_the_best() -> None:
    rng = np.random.default_rng(1)
    at_random = rng.standard_normal((200, 14, 3))
    at_random /= np.linalg.norm(at_random, axis=2, keepdims=True)
    ours = variance(chosen(14))
    assert ours < np.quantile([variance(ups) for ups in at_random], 0.02)
    assert ours < 1.35 / 14  # no design is below 1 / n


def test_a_turn_is_as_short_as_the_information_allows() -> None:
    last = np.array([1.0, 0.0, 0.0])
    found = next_orientation(np.array([[0.0, 0.0, 1.0], last]), last)
    assert found.up @ last == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("up", "words"),
    [((0, 0, 1), "+z side up"), ((1, 0, -1), "edge +x -z up"), ((-1, 1, 1), "corner -x +y +z up")],
)
def test_orientations_are_described_in_words(up: tuple[float, ...], words: str) -> None:
    direction = np.array(up) / np.linalg.norm(up)
    assert orientation_words(direction) == words
    assert name_orientation(words) == pytest.approx(direction)
    assert name_orientation("the blue side up") is None


@pytest.mark.parametrize(
    ("last", "up", "words"),
    [
        ((0, 0, 1), (1, 0, 0), "turn it by 90 deg, so that its +x side rises"),
        ((0, 0, 1), (0, 0, -1), "turn it upside down"),
        ((0, 1, 0), (0, 1, 1), "turn it by 45 deg, so that its +z side rises"),
        ((0, 1, 0), (0, 1, 0), "leave it as it is"),
    ],
)
def test_turns_are_described_in_words(last: tuple[float, ...], up: tuple[float, ...], words: str) -> None:
    one, other = (np.array(v) / np.linalg.norm(v) for v in (last, up))
    assert turn_words(one, other) == words


def test_another_position_is_taken_if_it_tells_about_as_much() -> None:
    taken = chosen(8)
    wanted = next_orientation(taken, taken[-1]).up
    assert is_informative(wanted, wanted, taken)
    assert not is_informative(taken[0], wanted, taken)
    others = [up for up in ORIENTATIONS if up @ wanted < 0.8 and is_informative(up, wanted, taken)]
    assert others  # a person who took another edge or corner need not turn back


def test_the_first_positions_must_differ() -> None:
    outputs = np.array([[2.6, 1.6, 1.6], [1.6, 2.6, 1.6]])
    assert not is_other_side(np.array([2.59, 1.61, 1.6]), outputs, 1e-3)
    assert is_other_side(np.array([1.6, 1.6, 2.6]), outputs, 1e-3)
    assert not is_other_side(outputs[0] + 1e-3, outputs[:1], 1e-3)
    assert is_other_side(outputs[1], outputs[:1], 1e-3)
    assert is_other_side(outputs[0], outputs[:0], 1e-3)


def test_directions_come_from_the_outputs_once_these_determine_the_zero() -> None:
    ups, zero = chosen(7), np.array([1.6, 1.7, 1.5])
    told = np.roll(ups, 1, axis=0)
    assert directions_up(zero + 0.8 * ups, told) == pytest.approx(ups)
    assert directions_up(zero + 0.8 * ups[:4], told[:4]) == pytest.approx(told[:4])


def test_coverage_counts_the_named_orientations() -> None:
    assert find_covered(np.zeros((0, 3))).sum() == 0
    assert find_covered(ORIENTATIONS).all()
    assert find_covered(ORIENTATIONS[:1]).sum() == 1
