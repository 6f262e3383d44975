"""Ways to visit poses: alpha moves first, then beta. Some are visited and kept out of the table, as fresh ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FRESH = 1 / 6  # of the moves have a stop half way that the analysis is not shown


@dataclass(frozen=True)
class Visits:
    """Poses in the order of their visit, shape (n,); `given` are those in the table."""

    alpha_deg: Array
    beta_deg: Array
    direction: Array
    given: NDArray[np.bool_]


def _sweeps(inclinations_deg: Array, up: Array, down: Array) -> tuple[Array, Array, Array]:
    beta = np.tile(np.concatenate([up, down]), len(inclinations_deg))
    direction = np.tile(np.repeat([1.0, -1.0], [len(up), len(down)]), len(inclinations_deg))
    return np.repeat(inclinations_deg, len(up) + len(down)), beta, direction


def ang(random: np.random.Generator) -> tuple[Array, Array, Array]:
    """Full turns both ways at +-alpha, 518 poses, as in Ang's paper; up and down at the same angles."""
    up = np.arange(0.0, 361.0, 10.0)
    return _sweeps(np.array([90.0, 30.0, 150.0, -30.0, -90.0, -150.0, 60.0]), up, up[::-1])


def seven(random: np.random.Generator) -> tuple[Array, Array, Array]:
    """Seven inclinations out of order; the way back stands between the poses of the way there."""
    up = np.arange(0.0, 361.0, 10.0)
    return _sweeps(random.permutation([15.0, 40.0, 65.0, 90.0, 115.0, 140.0, 165.0]), up, up[::-1] - 5.0)


def turntable(random: np.random.Generator) -> tuple[Array, Array, Array]:
    """A table turned on and on in steps of 13 deg, then back, at six inclinations."""
    up = 13.0 * np.arange(29)
    return _sweeps(random.permutation([90.0, 20.0, 55.0, 125.0, 160.0, 75.0]), up, up[::-1] - 6.0)


def scattered(random: np.random.Generator) -> tuple[Array, Array, Array]:
    """60 to 150 poses, spread evenly over the sphere, in random order."""
    count = int(random.integers(60, 151))
    alpha = np.round(np.degrees(np.arccos(random.uniform(-1, 1, count))), 1)
    beta = np.round(random.permutation(np.arange(count)) * 360.0 / count, 1)
    return alpha, beta, np.sign(np.diff(beta, prepend=-1.0))


def upright(random: np.random.Generator) -> tuple[Array, Array, Array]:
    """One inclination only, five turns there and back."""
    up = np.arange(0.0, 361.0, 10.0)
    return _sweeps(np.full(5, 90.0), up, up[::-1] - 5.0)


def one_way(random: np.random.Generator) -> tuple[Array, Array, Array]:
    """Clockwise only: the table goes on and on."""
    beta = np.tile(np.arange(5.0, 365.0, 10.0), 7)
    alpha = np.repeat(random.permutation([15.0, 40.0, 65.0, 90.0, 115.0, 140.0, 165.0]), 36)
    return alpha, beta + 360.0 * np.repeat(np.arange(7), 36), np.ones(len(beta))


LAYOUTS: dict[str, Callable[[np.random.Generator], tuple[Array, Array, Array]]] = {
    "ang": ang,
    "seven": seven,
    "turntable": turntable,
    "scattered": scattered,
    "upright": upright,
    "one way": one_way,
}
USUAL = ("ang", "seven", "turntable", "scattered")


def visits(name: str, random: np.random.Generator) -> Visits:
    """A layout with fresh poses half way of some of its moves of beta, which leave its path as it is."""
    alpha, beta, direction = LAYOUTS[name](random)
    moves = np.diff(beta)
    stops = 1 + np.flatnonzero((moves * direction[1:] > 1.0) & (random.random(len(moves)) < FRESH))
    given = np.insert(np.ones(len(beta), dtype=bool), stops, False)
    half_way = beta[stops] - moves[stops - 1] / 2
    return Visits(
        np.insert(alpha, stops, alpha[stops]),
        np.insert(beta, stops, half_way),
        np.insert(direction, stops, direction[stops]),
        given,
    )
