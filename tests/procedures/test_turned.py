"""magnetometer-turn and rate-turn on the simulated world, without sockets."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.world.config import WorldConfig
from drivers.world.world import World
from procedures.errors import SettingError
from procedures.magnetometer_turn import magnetometer_turn
from procedures.rate_turn import rate_turn
from procedures.session import Pose
from tests.procedures.bench import Book, session


def measured(procedure: object, *, dwells: tuple = (), **settings: object) -> Book:
    rig, book = session(World(WorldConfig.ideal(), seed=3), dwells=dwells)
    procedure(rig, **settings)
    return book


@pytest.fixture(scope="module")
def turns() -> Book:
    return measured(rate_turn, rates_deg_s=(60.0,), rest_s=0.5)


def test_each_edge_is_turned_about_both_ways_up_and_down_and_rests_at_both_headings(turns: Book) -> None:
    poses = [dwell.pose for dwell in turns.dwells]
    assert [pose.up for pose in poses] == [*"zzzzzzzz", *"xxxxxxxx", *"yyyyyyyy"]
    assert [pose.alpha_deg for pose in poses[:8]] == [0.0] * 4 + [180.0] * 4
    assert [(pose.beta_deg, pose.rate_deg_s) for pose in poses[:4]] == [
        (0.0, 0.0),
        (180.0, 0.0),
        (-180.0, 60.0),
        (180.0, -60.0),
    ]
    assert turns.asked == ["mounting", "mount-0-x-up", "mount-0-y-up"]


def test_all_samples_of_a_turn_are_kept(turns: Book) -> None:
    """360 deg at 60 deg/s are 6 s; all of it at the rate, whatever the edge and the side."""
    whole = [kept for kept in turns.blocks if kept.pose.rate_deg_s]
    assert {len(kept.samples.volts) for kept in whole} == {6000}
    axis = ["xyz".index(kept.pose.up) for kept in whole]
    felt = np.array([kept.samples.volts[:, k].mean() - 2.5 for kept, k in zip(whole, axis, strict=True)])
    signs = np.array([-np.sign(kept.pose.rate_deg_s) for kept in whole])
    assert signs * felt == pytest.approx(np.full(12, 60 * 6.05e-3), rel=1e-3)
    assert max(kept.samples.volts[:, k].std() for kept, k in zip(whole, axis, strict=True)) < 2e-3


def test_recorded_turns_are_not_repeated(turns: Book) -> None:
    again = measured(rate_turn, dwells=tuple(turns.dwells[:-1]), rates_deg_s=(60.0,), rest_s=0.5)
    assert len(again.dwells) == len(turns.dwells)
    assert len(again.blocks) == 1


def test_a_magnetometer_goes_round_on_each_edge_upward_and_downward() -> None:
    poses = [dwell.pose for dwell in measured(magnetometer_turn, step_deg=45.0, dwell_s=0.05).dwells]
    assert len(poses) == 3 * 2 * 8
    assert poses[0] == Pose(0.0, 0.0, 1, "z up", up="z")
    assert poses[8] == Pose(180.0, 315.0, -1, "z down", up="z")
    assert list(dict.fromkeys(pose.path for pose in poses)) == [
        f"{edge} {side}" for edge in "zxy" for side in ("up", "down")
    ]


def test_one_mount_without_over_is_the_horizontal_turn_of_the_book() -> None:
    poses = [d.pose for d in measured(magnetometer_turn, step_deg=45.0, mounts=1, over=False, dwell_s=0.05).dwells]
    assert {(pose.alpha_deg, pose.up) for pose in poses} == {(0.0, "z")}
    assert len(poses) == 8


@pytest.mark.parametrize(
    ("procedure", "settings", "words"),
    [
        (rate_turn, {"rates_deg_s": ()}, "rates_deg_s"),
        (rate_turn, {"rates_deg_s": (20.0, -20.0)}, "must be above 0"),
        (rate_turn, {"turn_deg": 0.0}, "turn_deg"),
        (rate_turn, {"mounts": 4}, "mounts is 4; give 1, 2 or 3"),
        (magnetometer_turn, {"step_deg": 60.0}, "at most 45"),
        (magnetometer_turn, {"mounts": 0}, "mounts is 0; give 1, 2 or 3"),
    ],
)
def test_settings_that_measure_nothing_are_refused(procedure: object, settings: dict, words: str) -> None:
    with pytest.raises(SettingError, match=words):
        measured(procedure, **settings)
