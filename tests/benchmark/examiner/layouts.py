"""Ten sequences of poses on a two-axis stage, and gravity in the frame of the sensor.

The outer stage turns by alpha about the y axis of the base, the inner one by beta about the axis that alpha carries:

    a = F Rz(mount) Rz(beta) Ry(alpha) R(tilt) ez

`mount` is a rotation of the sensor on its table; `F` is a flip by half a turn about x. All angles here are in degrees.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Row = tuple[float, float, float, float, float]  # alpha, beta, path, mount, flip

RAD = math.pi / 180
FIRST_MOVE_DEG = 40.0  # assumed move of the inner stage before the first pose


@dataclass(frozen=True, eq=False)
class Poses:
    """A sequence of n poses, columns (n,). `path` numbers the sweeps; `flip` is 1 after half a turn about x."""

    layout: str
    alpha: Array
    beta: Array
    path: Array
    mount: Array
    flip: Array

    @property
    def n(self) -> int:
        """Number of poses."""
        return len(self.alpha)

    @cached_property
    def direction(self) -> Array:
        """Sign of the last move of the inner stage, 0 before the first move.

        The first pose of a way back has the angle of the last pose of the way there, and is approached from beyond it:
        it has the direction of the way back. With alpha as the inner loop, beta does not move at the turn.
        """
        direction, last = np.zeros(self.n), 0.0
        for i in range(1, self.n):
            move = self.beta[i] - self.beta[i - 1]
            if abs(move) > 1e-9:
                last = 1.0 if move > 0 else -1.0
            direction[i] = last
        direction[0] = 1.0 if self.beta[1] > self.beta[0] else 0.0
        if self.layout != "alpha_inner":
            for i in range(1, self.n - 1):
                ahead = self.beta[i + 1] - self.beta[i]
                if self.path[i] != self.path[i - 1] and self.beta[i] == self.beta[i - 1] and ahead:
                    direction[i] = np.sign(ahead)
        return direction

    @cached_property
    def side(self) -> Array:
        """Side of the teeth on which the gear of the inner stage rests, 1 or -1."""
        return np.where(self.direction == 0, 1.0, self.direction)

    @cached_property
    def move(self) -> Array:
        """Length of the move of the inner stage before each pose."""
        return np.r_[FIRST_MOVE_DEG, np.abs(np.diff(self.beta))]

    def turns_round(self, i: int) -> bool:
        """Whether pose `i` repeats the inner angle of the pose before, approached from the other side."""
        return i > 0 and self.beta[i] == self.beta[i - 1] and self.side[i] != self.side[i - 1]


def gravity(poses: Poses, alpha: ArrayLike, beta: ArrayLike, tilt_x: ArrayLike = 0.0, tilt_y: ArrayLike = 0.0) -> Array:
    """Specific force in the sensor, g, (n, 3), at the given angles of the stages. Tilts of the base in rad."""
    return turned(alpha, beta, tilt_x, tilt_y, poses.mount, poses.flip)


def turned(alpha: ArrayLike, beta: ArrayLike, tilt_x: ArrayLike, tilt_y: ArrayLike, mount: Array, flip: Array) -> Array:
    """Specific force in the sensor, g, (n, 3). Angles in degrees, tilts as a rotation vector in rad."""
    a, b = np.asarray(alpha) * RAD, np.asarray(beta) * RAD
    tx, ty = np.broadcast_to(tilt_x, a.shape), np.broadcast_to(tilt_y, a.shape)
    angle = np.hypot(tx, ty)
    k = np.where(angle > 0, np.sin(angle) / np.where(angle > 0, angle, 1), 1.0)
    ux, uy, uz = ty * k, -tx * k, np.cos(angle)
    vx, vy, vz = np.cos(a) * ux + np.sin(a) * uz, uy, -np.sin(a) * ux + np.cos(a) * uz
    b = b + mount * RAD
    sx, sy = np.cos(b) * vx - np.sin(b) * vy, np.sin(b) * vx + np.cos(b) * vy
    s = np.where(flip == 1, -1.0, 1.0)
    return np.stack([sx, s * sy, s * vz], -1)


def draw_poses(random: np.random.Generator, layout: str) -> Poses:
    """A sequence of poses of one layout."""
    alpha, beta, path, mount, flip = np.array(LAYOUTS[layout](random), float).T
    return Poses(layout, alpha, beta, path, mount, flip)


def _sweeps(alphas: Iterable[float], betas: Array, mount: float = 0, flip: float = 0, first: int = 0) -> list[Row]:
    """At each alpha, beta there and back."""
    rows: list[Row] = []
    for k, a in enumerate(alphas):
        rows += [(a, b, first + 2 * k, mount, flip) for b in betas]
        rows += [(a, b, first + 2 * k + 1, mount, flip) for b in betas[::-1]]
    return rows


def _nested(random: np.random.Generator) -> list[Row]:
    """Six uneven inclinations."""
    choice = [20, 25, 35, 50, 55, 70, 75, 90, 105, 115, 130, 140, 155]
    return _sweeps(sorted(random.choice(choice, 6, replace=False)), np.arange(0, 361, 15.0))


def _alpha_inner(random: np.random.Generator) -> list[Row]:
    """Beta is the outer loop; at each beta, alpha goes there and back."""
    step = float(random.choice([18, 20]))
    rows: list[Row] = []
    for k, b in enumerate(np.arange(0, 360, 30.0) + float(random.choice([0, 7.5]))):
        up = np.arange(0, 181, step)
        rows += [(a, b, 2 * k, 0, 0) for a in up]
        rows += [(a, b, 2 * k + 1, 0, 0) for a in up[::-1]]
    return rows


def _random(random: np.random.Generator) -> list[Row]:
    """Uniform on the sphere, rounded to 5 arc minutes."""
    n = int(random.integers(190, 300))
    alpha = np.round(np.arccos(random.uniform(-1, 1, n)) / RAD * 12) / 12
    beta = np.round(random.uniform(0, 360, n) * 12) / 12
    return [(a, b, 0, 0, 0) for a, b in zip(alpha, beta, strict=True)]


def _irregular(random: np.random.Generator) -> list[Row]:
    """Five inclinations of both signs, with uneven steps of beta."""
    rows: list[Row] = []
    for k, a in enumerate([-120.0, -75.0, 40.0, 90.0, 152.5]):
        sums = np.cumsum(random.uniform(5, 15, 60))
        betas = np.r_[0.0, np.round(sums[sums < 360] * 12) / 12]
        rows += [(a, b, 2 * k, 0, 0) for b in betas]
        rows += [(a, b, 2 * k + 1, 0, 0) for b in betas[::-1]]
    return rows


def _optimal(random: np.random.Generator) -> list[Row]:
    """Sixty poses, each the one of highest leverage in a cubic polynomial of the force, in a random order.

    A greedy D-optimal design with replacement. Source: Fedorov, Theory of Optimal Experiments (1972).
    """
    grid = np.array([(a, b) for a in np.arange(5, 180, 12.5) for b in np.arange(0, 360, 12.5)])
    s = np.sin(grid[:, 0] * RAD)
    x, y, z = s * np.cos(grid[:, 1] * RAD), s * np.sin(grid[:, 1] * RAD), np.cos(grid[:, 0] * RAD)
    second = [x * x, x * y, x * z, y * y, y * z]
    third = [x**3, y**3, x * x * y, x * y * y, x * z * z, y * z * z]
    P = np.column_stack([np.ones(len(grid)), x, y, z, *second, *third])
    M, chosen = 1e-3 * np.eye(P.shape[1]), []
    for _ in range(60):
        leverage = np.einsum("ij,ij->i", P, np.linalg.solve(M, P.T).T) * random.uniform(0.9, 1, len(grid))
        best = int(np.argmax(leverage))
        chosen.append(best)
        M += np.outer(P[best], P[best])
    return [(grid[i, 0], grid[i, 1], 0, 0, 0) for i in random.permutation(chosen)]


def _optimal_and_sweep(random: np.random.Generator) -> list[Row]:
    """An optimal design, then two inclinations there and back."""
    return _optimal(random) + _sweeps([90.0, 45.0], np.arange(0, 361, 12.0), first=1)


def _two_days(random: np.random.Generator) -> list[Row]:
    """Three inclinations on each of two days; the room's clock adds the night between them."""
    betas = np.arange(0, 361, 12.0)
    return _sweeps([30.0, 90.0, 135.0], betas) + _sweeps([60.0, 90.0, 120.0], betas, first=6)


def _serpentine(random: np.random.Generator) -> list[Row]:
    """Thirteen inclinations of both signs; beta goes there in one and back in the next."""
    beta = np.arange(-180, 181, 15.0)
    rows: list[Row] = []
    for k, a in enumerate(np.linspace(-165, 165, 13)):
        rows += [(round(a, 1), b, k, 0, 0) for b in (beta if k % 2 == 0 else beta[::-1])]
    return rows


def _large(random: np.random.Generator) -> list[Row]:
    """700 poses: seven inclinations, fifty angles there and back."""
    return _sweeps([15.0, 42.0, 68.0, 90.0, 111.0, 137.0, 163.0], np.linspace(0, 360, 50))


def _flip_and_mount(random: np.random.Generator) -> list[Row]:
    """Three inclinations; again after a quarter of a turn of the sensor on its table; again after a flip."""
    beta, alphas = np.arange(0, 361, 20.0), [40.0, 90.0, 125.0]
    rest = _sweeps(alphas, beta, mount=90, first=6) + _sweeps(alphas, beta, flip=1, first=12)
    return _sweeps(alphas, beta) + rest


LAYOUTS: dict[str, Callable[[np.random.Generator], list[Row]]] = {
    "nested": _nested,
    "alpha_inner": _alpha_inner,
    "random": _random,
    "irregular": _irregular,
    "optimal60": _optimal,
    "optimal_and_sweep": _optimal_and_sweep,
    "two_days": _two_days,
    "serpentine": _serpentine,
    "large": _large,
    "flip_and_mount": _flip_and_mount,
}
THERE_AND_BACK = ("nested", "irregular", "two_days", "large", "flip_and_mount", "optimal_and_sweep")
