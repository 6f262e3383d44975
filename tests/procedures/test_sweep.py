"""The poses of a sweep: which, in what order, and from which side."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from procedures.errors import SettingError
from procedures.session import Pose
from procedures.sweep import INCLINATIONS_DEG, REFERENCE, grid, turn, with_references

STEPS = st.sampled_from([180 / k for k in range(1, 40)])
ANGLES = st.lists(st.floats(-180, 180), min_size=1, max_size=4, unique=True)


def test_the_default_grid_is_7_inclinations_of_37_angles_each_way() -> None:
    poses = list(grid(INCLINATIONS_DEG, 10.0))
    assert len(poses) == 7 * 37 * 2 == len(set(poses))
    assert poses[0] == Pose(90, 0, 1, "A+ to B-")
    assert poses[36] == Pose(90, 360, 1, "A+ to B-")
    assert poses[37] == Pose(90, 360, -1, "B+ to A-")
    assert poses[-1] == Pose(135, 0, -1, "B+ to A-")


def test_inclinations_are_out_of_order_so_that_height_does_not_follow_time() -> None:
    assert sorted(INCLINATIONS_DEG) not in (list(INCLINATIONS_DEG), list(INCLINATIONS_DEG)[::-1])


def test_angs_paths_add_negative_inclinations_and_half_turns() -> None:
    poses = list(grid((90.0, 30.0), 10.0, "ang"))
    assert {pose.alpha_deg for pose in poses} == {90, -90, 30, -30}
    half = [pose.beta_deg for pose in poses if pose.path == "B+ to B-"]
    assert half == [*range(0, -181, -10), *range(-180, 1, 10)]
    assert len(poses) == 4 * 74 + 2 * 38
    assert len(set(poses)) == len(poses)


@given(ANGLES, STEPS, st.sampled_from(["grid", "ang"]))
def test_steps_are_even_and_each_turn_is_closed(inclinations: list[float], step: float, paths: str) -> None:
    poses = list(grid(inclinations, step, paths))
    for a, b in pairwise(poses):
        same = (a.alpha_deg, a.path, a.direction) == (b.alpha_deg, b.path, b.direction)
        if same and a.beta_deg not in (360, 180):
            assert b.beta_deg - a.beta_deg == pytest.approx(step * a.direction)
    assert len(set(poses)) == len(poses)
    full = [pose for pose in poses if pose.path == "A+ to B-"]
    assert sum(pose.beta_deg == pytest.approx(360) for pose in full) == len({pose.alpha_deg for pose in full})


def test_a_level_inclination_has_no_negative() -> None:
    assert len(list(grid((0.0,), 180.0, "ang"))) == 6


def test_a_turn_has_the_requested_direction() -> None:
    assert [pose.beta_deg for pose in turn(90, 180, 0, 90, "")] == [180, 90, 0]
    assert {pose.direction for pose in turn(90, 180, 0, 90, "")} == {-1}
    assert {pose.direction for pose in turn(90, -180, 0, 90, "")} == {1}


@pytest.mark.parametrize("step", [0, -10, 7, 181, float("nan")])
def test_a_step_that_does_not_divide_half_a_turn_is_refused(step: float) -> None:
    with pytest.raises(SettingError, match="step_deg"):
        list(grid((90.0,), step))


def test_no_inclination_is_refused() -> None:
    with pytest.raises(SettingError, match="inclinations_deg is empty"):
        list(grid((), 10.0))


def test_the_reference_pose_comes_first_last_and_between() -> None:
    poses = list(turn(90, 0, 180, 45, "up"))
    kept = with_references(poses, 2)
    assert [pose == REFERENCE for pose in kept] == [True, False, False, True, False, False, True, False, True]
    assert [pose for pose in kept if pose != REFERENCE] == poses
    assert with_references(poses, 0) == poses
