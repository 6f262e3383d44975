"""The way from each pose to the next, as a sensor with a memory feels it.

The stages start at home (alpha = 0), alpha moves first, then beta, by way of the approach from the side of `direction`.
Only where a component of the specific force turns round on the way does it matter: those points are kept.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from calibrations.chain import Pose, specific_force
from calibrations.table import Array, Table

SAMPLES = 24  # of each stage's move
TURNS = 6  # kept for each axis, on the way to one pose


@lru_cache(maxsize=8)
def turning_points(table: Table) -> Array:
    """Specific force along each reference axis where it turns round on the way to each pose, shape (n, TURNS, 3).

    Rows in order of time. Moves with fewer turns repeat the last point, which changes nothing.
    """
    alpha, beta = np.radians(table.column("alpha_deg")), np.radians(table.column("beta_deg"))
    away = beta - np.radians(_approach_deg(table)) * table.optional("direction", 0.0)
    before_alpha, before_beta = np.append(0.0, alpha[:-1]), np.append(beta[0], beta[:-1])
    if "t_s" not in table:  # the order is not known: each pose is reached from its approach alone
        before_alpha, before_beta = alpha, away
    u = np.linspace(0.0, 1.0, SAMPLES)
    still = np.zeros((table.n, SAMPLES))
    alphas = np.hstack([before_alpha[:, None] + np.outer(alpha - before_alpha, u), still + alpha[:, None]])
    betas = np.hstack([still + before_beta[:, None], before_beta[:, None] + np.outer(away - before_beta, u)])
    return _turns(_along(table, np.column_stack([alphas, alpha]), np.column_stack([betas, beta])))


@lru_cache(maxsize=8)
def last_turn(table: Table) -> Array:
    """Side of the last move of beta before each pose, +1 or -1, shape (n,): that on which the gear's play lies.

    A pose that was reached without a move of beta keeps the side of the pose before. Rows in order of time.
    """
    direction = table.optional("direction", 0.0)
    if _approach_deg(table) > 0:
        return direction
    moved = np.sign(np.diff(table.column("beta_deg"), prepend=np.nan))
    moved[0] = 0.0  # before the first move the side is not known
    last = np.maximum.accumulate(np.where(moved != 0, np.arange(table.n), 0))
    return np.asarray(moved[last])


def _approach_deg(table: Table) -> float:
    """How far before a pose its approach begins: a constant of the table."""
    return table.number("approach_deg", 0.0 if "t_s" in table else 10.0)


def _along(table: Table, alphas: Array, betas: Array) -> Array:
    """Specific force on the paths, shape (n, points, 3)."""
    n, points = alphas.shape
    mount = np.repeat(np.radians(table.optional("mount_deg", 0.0)), points)
    flip = np.repeat(table.optional("flip", 0.0), points)
    up = np.array([0.0, 0.0, 1.0])
    return specific_force(Pose(alphas.ravel(), betas.ravel(), mount, flip, up)).reshape(n, points, 3)


def _turns(path: Array) -> Array:
    kept = np.repeat(path[:, :1, :], TURNS, axis=1)
    rising = np.diff(path, axis=1)
    moving = np.abs(rising) > 1e-9
    turned = moving[:, :-1] & ((rising[:, 1:] * rising[:, :-1] < 0) | ~moving[:, 1:])
    for i, k in zip(*np.nonzero(turned.any(axis=1)), strict=True):
        at = np.flatnonzero(turned[i, :, k]) + 1
        values = path[i, at[-TURNS:], k]
        kept[i, :, k] = np.concatenate([values, np.full(TURNS - len(values), values[-1])])
    return kept
