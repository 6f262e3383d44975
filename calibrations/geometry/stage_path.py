"""The path of the stages from pose to pose, and the specific force along it, for sensors with hysteresis.

The stages start at home (0, 0); alpha moves first, then beta. Beta arrives from the side of `direction`: where a move
comes from the other side, it passes through the approach, `approach_deg` before the pose.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from calibrations.criteria import SHORTEST_APPROACH_DEG
from calibrations.geometry.orientation import Pose, specific_force
from calibrations.table import Array, Table

STATED_APPROACH = -1.0  # an approach as the table states it


@lru_cache(maxsize=64)
def with_approach(table: Table, by_deg: float) -> Table:
    """The table with an approach that begins this angle before each pose; the same table for `STATED_APPROACH`."""
    return table if by_deg < 0 else replace(table, constants={**table.constants, "approach_deg": by_deg})


@lru_cache(maxsize=8)
def turning_points(table: Table) -> Array:
    """Specific force along each axis at its turning points on the way to each pose, shape (n, points, 3).

    Rows in order of time. Other points on the way are included; they have no effect.
    """
    alpha, beta = np.radians(table.column("alpha_deg")), np.radians(table.column("beta_deg"))
    beta_start = beta - np.radians(_approach_deg(table)) * table.optional("direction", 0.0)
    if "t_s" not in table:  # the order is not known: each pose is reached from its approach alone
        last = _forces_between_poses(table, alpha, beta_start, np.zeros(table.n), beta - beta_start)
        return np.concatenate([_at(table, alpha, beta_start)[:, None], last[:, :-1]], axis=1)
    before_alpha, before_beta = np.append(0.0, alpha[:-1]), np.append(0.0, beta[:-1])
    by_way = np.where(_needs_approach(table, beta - before_beta), beta_start, before_beta)
    moves = (
        _forces_between_poses(table, before_alpha, before_beta, alpha - before_alpha, np.zeros(table.n)),
        _forces_between_poses(table, alpha, before_beta, np.zeros(table.n), by_way - before_beta),
        _forces_between_poses(table, alpha, by_way, np.zeros(table.n), beta - by_way),
    )
    return np.ascontiguousarray(np.concatenate(moves, axis=1)[:, :-1])  # the last point is the pose itself


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


def _forces_between_poses(table: Table, alpha: Array, beta: Array, by_alpha: Array, by_beta: Array) -> Array:
    """Specific force at its turning points while one of the stages moves, and at the end, shape (n, turns + 1, 3).

    Along each axis it is m + A cos s + B sin s, with s the angle gone through: it turns every half turn.
    """

    def after(s: float) -> Array:
        return _at(table, alpha + s * np.sign(by_alpha), beta + s * np.sign(by_beta))

    start, quarter, opposite = after(0.0), after(np.pi / 2), after(np.pi)
    middle = (start + opposite) / 2
    A, B = start - middle, quarter - middle
    end = np.abs(by_alpha + by_beta)[:, None, None]
    turns = np.arange(max(1, int(np.ceil(np.max(end) / np.pi))))[:, None]
    s = np.minimum((np.arctan2(B, A) % np.pi)[:, None] + np.pi * turns, end)
    s = np.concatenate([s, np.broadcast_to(end, (table.n, 1, 3))], axis=1)
    return np.asarray(middle[:, None] + A[:, None] * np.cos(s) + B[:, None] * np.sin(s))


def _at(table: Table, alpha: Array, beta: Array) -> Array:
    """Specific force with the stages at these angles, shape (n, 3)."""
    mount, flip = np.radians(table.optional("mount_deg", 0.0)), table.optional("flip", 0.0)
    return specific_force(Pose(alpha, beta, mount, flip, np.array([0.0, 0.0, 1.0])))
