"""The path of the stages from pose to pose, and the specific force along it, for sensors with hysteresis.

The stages start at home (0, 0); alpha moves first, then beta. Beta arrives from the side of `direction`: where a move
comes from the other side, it passes through the approach, `approach_deg` before the pose.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from calibrations.criteria import SHORTEST_APPROACH_DEG
from calibrations.geometry.orientation import Pose, nominal_pose, reported_force, specific_force
from calibrations.table import Array, Table

SAME_DIRECTION = 1e-6  # of the largest singular value: products below that the poses do not tell apart
STATED_APPROACH = -1.0  # an approach as the table states it
APPROACH_DOC = "turn of beta before a pose (deg; -1: as the table states it)"
_LATEST: list[tuple[Table, Array, Array]] = []  # at most one path: its table, the force at the poses, its points


@lru_cache(maxsize=64)
def with_approach(table: Table, by_deg: float) -> Table:
    """The table with an approach that begins this angle before each pose; the same table for `STATED_APPROACH`."""
    return table if by_deg < 0 else replace(table, constants={**table.constants, "approach_deg": by_deg})


@lru_cache(maxsize=8)
def turning_points(table: Table) -> Array:
    """Specific force along each axis of an ideal rig at its turning points on the way to each pose, (n, points, 3), g.

    Rows in order of time. Other points on the way are included; they have no effect.
    """
    mount, flip = _repeat(table, "mount_deg"), _repeat(table, "flip")
    forces = [_force(alpha, beta, mount, flip)[..., k] for k, (alpha, beta) in enumerate(_angles_of_axes(table))]
    return np.stack(forces, axis=2)


def sensed_turning_points(table: Table, a: Array) -> Array:
    """The turning points of the force that a sensor with these values at the poses senses, shape (n, points, 3), g.

    `a` is the specific force along the sensing axes at the poses, (n, 3), g. A sensor at an angle in its package, a
    tilted base and offsets of the stages change the force at the poses and between them alike: the change is a linear
    function of the products of the sines and cosines of both stage angles, which follows from its values at the poses.
    The rest of the change, for example by the play of a gear, is not linear: all points on the way to a pose get the
    rest at this pose. Without the change, the force would jump to that of an ideal rig and back between two poses, and
    the slip elements would follow these jumps.

    A derivative by each parameter asks for the same path: the last one is kept.
    """
    for known_table, known_a, path in _LATEST:
        if known_table is table and known_a is a:
            return path
    path = _changed_path(table, a - reported_force(table))
    _LATEST[:] = [(table, a, path)]
    return path


def _changed_path(table: Table, change: Array) -> Array:
    """`sensed_turning_points` for a `change` of the force at the poses, (n, 3), g."""
    if not change.any():
        return turning_points(table)
    at_poses, solving, at_turns = _products_of_angles(table)
    coefficients = solving @ change
    left = change - at_poses @ coefficients
    changes = np.matmul(at_turns, coefficients.T[:, :, None]).reshape(3, table.n, -1)
    return np.ascontiguousarray(turning_points(table) + np.moveaxis(changes, 0, 2) + left[:, None])


@lru_cache(maxsize=8)
def _products_of_angles(table: Table) -> tuple[Array, Array, Array]:
    """Products of sines and cosines of the angles, of which errors of the geometry are linear functions.

    At the poses, (n, m); the matrix that solves for the coefficients, (m, n); where the force along each axis turns,
    (3, n * points, m).
    """
    mount, flip = _repeat(table, "mount_deg"), _repeat(table, "flip")
    alpha, beta = nominal_pose(table).alpha, nominal_pose(table).beta
    at_turns = [_products(alpha, beta + mount, flip) for alpha, beta in _angles_of_axes(table)]
    at_poses = _products(alpha, beta + mount[:, 0], flip[:, 0])
    return (
        at_poses,
        np.asarray(np.linalg.pinv(at_poses, rcond=SAME_DIRECTION), float),
        np.stack([p.reshape(-1, p.shape[-1]) for p in at_turns]),
    )


def _products(alpha: Array, turn: Array, flip: Array) -> Array:
    """Products of sines and cosines of both angles, of both mountings, shape (..., 16)."""
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(turn), np.sin(turn)
    products = np.stack([cb * ca, cb * sa, cb, sb * ca, sb * sa, sb, ca, sa], axis=-1)
    return np.concatenate([products, products * np.where(flip > 0, -1.0, 1.0)[..., None]], axis=-1)


@lru_cache(maxsize=8)
def _angles_of_axes(table: Table) -> tuple[tuple[Array, Array], ...]:
    """alpha and beta, rad, where the force along each axis turns on the way to each pose, shape (n, points) each."""
    alpha, beta = np.radians(table.column("alpha_deg")), np.radians(table.column("beta_deg"))
    beta_start = beta - np.radians(_approach_deg(table)) * table.optional("direction", 0.0)
    none = np.zeros(table.n)
    if "t_s" not in table:  # the order is not known: each pose is reached from its approach alone
        ways = [(alpha, beta_start, none, none), (alpha, beta_start, none, beta - beta_start)]
    else:
        before_alpha, before_beta = np.append(0.0, alpha[:-1]), np.append(0.0, beta[:-1])
        by_way = last_starts(table)
        ways = [
            (before_alpha, before_beta, alpha - before_alpha, none),
            (alpha, before_beta, none, by_way - before_beta),
            (alpha, by_way, none, beta - by_way),
        ]
    passed = [_angles_between_poses(table, *way) for way in ways]
    joined = [np.concatenate(each, axis=1)[:, :-1] for each in zip(*passed, strict=True)]  # without the pose itself
    return tuple((joined[0][:, :, k], joined[1][:, :, k]) for k in range(3))


def last_starts(table: Table) -> Array:
    """beta, rad, where its last move to each pose starts, (n,): at the pose before, or where the approach starts."""
    beta = np.radians(table.column("beta_deg"))
    before = np.append(0.0, beta[:-1])
    approach_starts = beta - np.radians(_approach_deg(table)) * table.optional("direction", 0.0)
    return np.where(_needs_approach(table, beta - before), approach_starts, before)


@lru_cache(maxsize=8)
def last_turn(table: Table) -> Array:
    """Direction of beta's last move before each pose, +1 or -1, shape (n,): the side of the gear play.

    A pose reached without a move of beta keeps the sense of the pose before. Rows in order of time.
    """
    sense = np.sign(np.diff(table.column("beta_deg"), prepend=np.nan))
    sense[0] = 0.0  # before the first move the side is not known
    if _approach_deg(table) > 0:
        direction = table.optional("direction", 0.0)
        sense = np.where(direction != 0, direction, sense)
    last = np.maximum.accumulate(np.where(sense != 0, np.arange(table.n), 0))
    return np.asarray(sense[last])


def _approach_deg(table: Table) -> float:
    """Distance of the approach from its pose: a constant of the table."""
    return table.number("approach_deg", 0.0 if "t_s" in table else 10.0)


def _needs_approach(table: Table, move: Array) -> Array:
    """The moves of beta (rad) that do not come from the side of `direction`."""
    direction = table.optional("direction", 0.0)
    return np.asarray((direction != 0) & (np.degrees(move) * direction < SHORTEST_APPROACH_DEG))


def _angles_between_poses(
    table: Table, alpha: Array, beta: Array, by_alpha: Array, by_beta: Array
) -> tuple[Array, Array]:
    """alpha and beta at the turning points of each axis while one stage moves, and at the end, (n, turns + 1, 3) each.

    The force along each axis is m + A cos s + B sin s, with s the angle gone through: it turns every half turn.
    """
    mount, flip = np.radians(table.optional("mount_deg", 0.0)), table.optional("flip", 0.0)

    def after(s: float) -> Array:
        return _force(alpha + s * np.sign(by_alpha), beta + s * np.sign(by_beta), mount, flip)

    start, quarter, opposite = after(0.0), after(np.pi / 2), after(np.pi)
    middle = (start + opposite) / 2
    A, B = start - middle, quarter - middle
    end = np.abs(by_alpha + by_beta)[:, None, None]
    turns = np.arange(max(1, int(np.ceil(np.max(end) / np.pi))))[:, None]
    s = np.minimum((np.arctan2(B, A) % np.pi)[:, None] + np.pi * turns, end)
    s = np.concatenate([s, np.broadcast_to(end, (table.n, 1, 3))], axis=1)
    return tuple(x[:, None, None] + s * np.sign(by)[:, None, None] for x, by in ((alpha, by_alpha), (beta, by_beta)))


def _force(alpha: Array, beta: Array, mount: Array, flip: Array) -> Array:
    """Specific force with the stages at these angles, rad, shape (..., 3)."""
    alpha, beta, mount, flip = np.broadcast_arrays(alpha, beta, mount, flip)
    pose = Pose(alpha.ravel(), beta.ravel(), mount.ravel(), flip.ravel(), np.array([0.0, 0.0, 1.0]))
    return specific_force(pose).reshape(*alpha.shape, 3)


def _repeat(table: Table, name: str) -> Array:
    """A column of the mounting, angles in rad, of shape (n, 1)."""
    values = table.optional(name, 0.0)
    return np.asarray(np.radians(values) if name.endswith("_deg") else values)[:, None]
