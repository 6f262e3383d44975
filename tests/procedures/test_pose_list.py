"""Poses from a file, as a setting of the sweep."""

from __future__ import annotations

from pathlib import Path

import pytest

from procedures.catalogue import find
from procedures.errors import SettingError
from procedures.pose_list import format_poses, parse_poses
from procedures.session import Pose
from procedures.settings import parse
from rig.bench import read_bench
from rig.planning.plan import plan

POSES = [Pose(90, 45, 1, "design"), Pose(90, 45, 1, "design"), Pose(-37.5, 0, -1, "check"), Pose(0, 350, 0, "", 90, 1)]


def test_written_values_are_read_again() -> None:
    assert parse_poses(format_poses(POSES)) == POSES


def test_a_hand_written_file_needs_two_columns_only() -> None:
    assert parse_poses(["# mine", "beta_deg, alpha_deg", "", "10, 20"]) == [Pose(20, 10)]


@pytest.mark.parametrize(
    ("lines", "complaint"),
    [
        ([], "give a header"),
        (["alpha_deg,beta_deg"], "at least one pose"),
        (["alpha_deg,direction", "1,1"], "give a header"),
        (["alpha_deg,beta_deg,directoin", "1,2,1"], "line 1: a pose has no column 'directoin'. Did you mean"),
        (["alpha_deg,beta_deg", "1,2", "1"], r"line 3: 1 values for 2 columns"),
        (["alpha_deg,beta_deg", *["1,2"] * 50_001, "no pose"], "the plan has 50002 poses; the limit is 50000"),
        (["alpha_deg,beta_deg", "1,nan"], "line 2, column beta_deg: the value is 'nan'; give a number"),
        (["alpha_deg,beta_deg,direction", "1,2,2"], "line 2, column direction: the value is '2'; give one of -1, 0, 1"),
    ],
)
def test_faults_of_a_pose_list_are_named(lines: list[str], complaint: str) -> None:
    with pytest.raises(SettingError, match=complaint):
        parse_poses(lines)


def test_a_sweep_visits_the_poses_of_a_file(tmp_path: Path) -> None:
    (tmp_path / "poses.csv").write_text("\n".join(format_poses(POSES)))
    sweep = find("sweep")
    settings = parse(sweep, {"pose_list": str(tmp_path / "poses.csv"), "dwell_s": "1"})
    (tmp_path / "poses.csv").unlink()
    again = parse(sweep, {**settings, "pose_list": list(settings["pose_list"])})  # as the record keeps it
    planned = plan(read_bench(), sweep, again)
    assert [held.pose for held in planned.held] == POSES
    assert planned.asked[0].name == "mounting"


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match=r"pose_list: cannot read the file .*none.csv: No such file"):
        parse(find("sweep"), {"pose_list": str(tmp_path / "none.csv")})


def test_a_pose_list_is_not_combined_with_other_poses() -> None:
    sweep = find("sweep")
    with pytest.raises(SettingError, match="pose_list has all poses"):
        plan(read_bench(), sweep, parse(sweep, {"pose_list": format_poses(POSES), "face": "both"}))
