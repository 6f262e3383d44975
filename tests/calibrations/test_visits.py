"""The way from pose to pose: which turns of the specific force it remembers."""

from __future__ import annotations

import numpy as np

from calibrations.geometry.orientation import nominal_pose, specific_force
from calibrations.geometry.stage_path import last_turn, turning_points
from calibrations.table import Array, Table


def way(alpha: list[float], beta: list[float], **more: list[float]) -> Table:
    given = {"alpha_deg": alpha, "beta_deg": beta, "vx_v": [0.0] * len(alpha), **more}
    constants = {"approach_deg": 10.0} if "direction" in more else {}
    return Table.from_columns("poses", given, constants)


def felt(table: Table, row: int, axis: int) -> Array:
    """Specific force along an axis on the way to a row and there, without repeats."""
    there = specific_force(nominal_pose(table))[row, axis]
    values = np.append(turning_points(table)[row, :, axis], there)
    return values[np.append(True, np.abs(np.diff(values)) > 1e-9)]


def test_the_way_between_poses_passes_the_extremes() -> None:
    """beta 0 -> 180 at alpha = 90: y rises to 1 g and comes back, x falls all the way."""
    table = way([90, 90], [0, 180], t_s=[0, 7])
    np.testing.assert_allclose(felt(table, 1, 1), [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(felt(table, 1, 0), [1.0, -1.0], atol=1e-12)


def test_a_long_move_turns_every_half_turn() -> None:
    table = way([90, 90], [-10, 390], t_s=[0, 7])
    near = np.cos(np.radians([10, 30]))
    np.testing.assert_allclose(felt(table, 1, 0), [near[0], 1.0, -1.0, 1.0, near[1]], atol=1e-12)


def test_starts_at_home_and_alpha_moves_first() -> None:
    """From alpha = 0 to 120: x passes 1 g at alpha = 90; then, back at 30, beta turns to 90 and x falls to nothing."""
    table = way([120, 30], [0, 90], t_s=[0, 7])
    np.testing.assert_allclose(felt(table, 0, 0), [1.0, np.sin(np.radians(120))], atol=1e-12)
    np.testing.assert_allclose(felt(table, 1, 0), [1.0, 0.5, 0.0], atol=1e-12)


def test_only_a_turn_of_direction_needs_the_approach() -> None:
    """beta 0 -> 90: from below nothing turns; from above y passes its top to 100 deg, and comes back to it."""
    up = way([90, 90], [0, 90], t_s=[0, 7], direction=[1, 1])
    np.testing.assert_allclose(felt(up, 0, 1), [0.0, np.sin(np.radians(-10)), 0.0], atol=1e-12)
    np.testing.assert_allclose(felt(up, 1, 1), [0.0, 1.0], atol=1e-12)
    down = way([90, 90], [0, 90], t_s=[0, 7], direction=[1, -1])
    np.testing.assert_allclose(felt(down, 1, 1), [0.0, 1.0, np.sin(np.radians(100)), 1.0], atol=1e-12)


def test_without_time_only_the_approach_counts() -> None:
    table = way([90, 30], [90, 90], direction=[1, -1])
    np.testing.assert_allclose(felt(table, 0, 1), [np.sin(np.radians(80)), 1.0], atol=1e-12)
    np.testing.assert_allclose(felt(table, 1, 0), [0.5 * np.cos(np.radians(100)), 0.0], atol=1e-12)


def test_a_pose_that_is_held_turns_nothing() -> None:
    turns = turning_points(way([90, 90], [40, 40], t_s=[0, 7]))
    np.testing.assert_allclose(turns[1] - turns[1, :1], 0.0, atol=1e-12)


def test_the_gear_lies_on_the_side_of_the_last_move() -> None:
    straight = way([90, 90, 90, 30], [0, 10, 0, 0], t_s=[0, 7, 14, 21])
    np.testing.assert_array_equal(last_turn(straight), [0, 1, -1, -1])
    approached = way([90, 90, 90, 30], [0, 10, 0, 0], t_s=[0, 7, 14, 21], direction=[-1, 0, 1, 0])
    np.testing.assert_array_equal(last_turn(approached), [-1, 1, 1, 1])
