"""The way from pose to pose: which turns of the specific force it remembers."""

from __future__ import annotations

import numpy as np

from calibrations.table import Array, Table
from calibrations.visits import turning_points

NEAR = 3e-3  # a turn is found to the step of the samples on the way


def way(alpha: list[float], beta: list[float], **more: list[float]) -> Table:
    given = {"alpha_deg": alpha, "beta_deg": beta, "vx_v": [0.0] * len(alpha), **more}
    constants = {"approach_deg": 10.0} if "direction" in more else {}
    return Table.from_columns("poses", given, constants)


def distinct(values: Array) -> Array:
    """Values without those that repeat the one before them."""
    return values[np.append(True, np.abs(np.diff(values)) > NEAR)]


def test_over_the_top_and_down() -> None:
    """beta 0 -> 180 at alpha = 90: y rises to 1 g and comes back, x falls all the way."""
    turns = turning_points(way([90, 90], [0, 180], t_s=[0, 7]))
    np.testing.assert_allclose(distinct(turns[1, :, 1]), [1.0, 0.0], atol=NEAR)
    np.testing.assert_allclose(distinct(turns[1, :, 0])[-1:], [-1.0], atol=NEAR)


def test_starts_at_home_and_alpha_moves_first() -> None:
    """From alpha = 0 to 120: x passes 1 g at alpha = 90; then beta turns to 90 and x falls to nothing."""
    turns = turning_points(way([120, 30], [0, 90], t_s=[0, 7]))
    np.testing.assert_allclose(distinct(turns[0, :, 0])[:2], [1.0, np.sin(np.radians(120))], atol=NEAR)
    # on the way from 120 to 30, at beta = 0, x passes 1 g again
    np.testing.assert_allclose(distinct(turns[1, :, 0]), [1.0, 0.5, 0.0], atol=NEAR)


def test_approach_from_the_side_of_direction() -> None:
    """beta 0 -> 90: from below nothing turns; from above y passes its top, and is reached from 100 deg."""
    up = turning_points(way([90, 90], [0, 90], t_s=[0, 7], direction=[0, 1]))
    np.testing.assert_allclose(up[1, :, 1], 0.0, atol=1e-12)
    down = turning_points(way([90, 90], [0, 90], t_s=[0, 7], direction=[0, -1]))
    np.testing.assert_allclose(distinct(down[1, :, 1])[:2], [1.0, np.sin(np.radians(100))], atol=NEAR)
    np.testing.assert_allclose(distinct(down[1, :, 0])[:1], np.cos(np.radians(100)), atol=NEAR)


def test_without_time_only_the_approach_counts() -> None:
    turns = turning_points(way([90, 30], [90, 90], direction=[1, -1]))
    np.testing.assert_allclose(turns[0, 0], [np.cos(np.radians(80)), np.sin(np.radians(80)), 0], atol=1e-12)
    np.testing.assert_allclose(turns[1, 0, 2], np.cos(np.radians(30)), atol=1e-12)
    np.testing.assert_allclose(turns[1, 0, 0], 0.5 * np.cos(np.radians(100)), atol=1e-12)


def test_a_pose_that_is_held_turns_nothing() -> None:
    turns = turning_points(way([90, 90], [40, 40], t_s=[0, 7]))
    np.testing.assert_allclose(turns[1] - turns[1, :1], 0.0, atol=1e-12)
