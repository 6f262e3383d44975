"""The search for the axes: its brackets, how it centres and ends, and what it finds on rigs whose axes are known."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from drivers.world.config import WorldConfig
from drivers.world.world import World
from procedures.errors import ProcedureError, SettingError
from procedures.misalignment import (
    Centre,
    centre_of,
    coarse_poses,
    extremes,
    is_off,
    misalignment,
    round_poses,
    standard_error_deg,
)
from procedures.session import Dwell, Pose
from tests.procedures.bench import session


def world(package: Mapping[str, float], seed: int = 1, **changes: Any) -> World:
    """A perfect rig with the sensor's package turned exactly so."""
    exact = {"spread": {"imperfection_fraction": 0.0}, "sensor": {"package": dict(package)}}
    return World(WorldConfig.ideal().changed(exact | changes), seed)


def dwells(poses: list[Pose], x: np.ndarray, y: np.ndarray) -> list[Dwell]:
    """Without noise: 2.5 V at 0 g, along `x` and `y`, V/g."""
    made = []
    for t_s, pose in enumerate(poses):
        a, b = np.radians([pose.alpha_deg, pose.beta_deg])
        load = np.array([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)])
        made.append(Dwell(pose, float(t_s), {"vx": 2.5 + load @ x, "vy": 2.5 + load @ y}, {}, 1))
    return made


def test_the_signs_of_a_bracket_cancel_drift_and_hysteresis() -> None:
    poses = list(round_poses(Centre(), 1))
    assert len(poses) == 16
    turn = [(k, p) for k, p in enumerate(poses) if p.path == "turn 1"]
    for axis, zero_crossings in (("x", (90, 270)), ("y", (0, 180))):
        mine = [(k, p) for k, p in turn if p.beta_deg % 360 in zero_crossings]
        way = 90 if axis == "x" else 0
        load = [np.sin(np.radians(p.alpha_deg)) * (1 if p.beta_deg % 360 == way else -1) for _, p in mine]
        side = [(-1 if axis == "x" else 1) * s * p.direction for s, (_, p) in zip(load, mine, strict=True)]
        assert load == [1, -1, -1, 1]
        assert np.dot(load, [k for k, _ in mine]) == np.dot(load, side) == 0
    for path in ("x 1", "y 1"):
        assert [np.cos(np.radians(p.alpha_deg)) for p in poses if p.path == path] == [1, -1, -1, 1]


def test_extremes_are_those_of_the_axes() -> None:
    x, y = np.array([0.99, 0.02, -0.05]), np.array([-0.03, 1.02, 0.01])
    for poses in (list(coarse_poses()), list(round_poses(Centre(3, (4, -2)), 1))):
        found = extremes(dwells(poses, x, y))
        assert found[0] == pytest.approx([np.degrees(0.02 / 0.99), np.degrees(0.05 / np.hypot(0.99, 0.02))], abs=4e-3)
        assert found[1] == pytest.approx([np.degrees(0.03 / 1.02), np.degrees(-0.01 / np.hypot(1.02, 0.03))], abs=2e-3)


def test_a_sensor_mounted_backwards_has_its_extremes_at_the_opposite_angles() -> None:
    found = extremes(dwells(list(coarse_poses()), np.array([-1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])))
    assert abs(centre_of(found).beta_deg) == 180


def test_only_a_bracket_far_from_its_centre_is_centred_again() -> None:
    assert not is_off(Centre(1, (0, -1)), Centre())
    assert is_off(Centre(0, (0, 2)), Centre())
    assert is_off(Centre(2), Centre())
    assert not is_off(Centre(-180), Centre(180))


def test_the_error_of_the_mean_needs_two_rounds() -> None:
    assert standard_error_deg([np.zeros((2, 2))]) == np.inf
    assert standard_error_deg([np.zeros((2, 2)), np.full((2, 2), 0.02)]) == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("package", "poses"),
    [
        ({"turn_x_deg": 0.75, "turn_y_deg": -1.3, "turn_z_deg": 0.33}, 6 + 32),
        ({"turn_x_deg": 4.0, "turn_y_deg": -6.0, "turn_z_deg": 25.0, "beams_off_square_deg": 1.0}, 6 + 32),
    ],
)
def test_two_rounds_are_enough_on_a_quiet_rig(package: Mapping[str, float], poses: int) -> None:
    rig, book = session(world(package))
    misalignment(rig, dwell_s=1.0)
    assert len(book.dwells) == poses
    found = extremes([d for d in book.dwells if d.pose.path.endswith(" 2")])
    assert found[0, 0] == pytest.approx(centre_of(found).beta_deg, abs=1.5)


def test_the_search_continues_while_rounds_disagree_and_ends_at_most_rounds() -> None:
    noisy = {"noise": {"white_v": 0.05}}
    rig, book = session(world({}, **noisy))
    misalignment(rig, dwell_s=0.2, target_deg=0.01, most_rounds=3)
    assert len(book.dwells) == 6 + 3 * 16


def test_a_resumed_search_continues_at_the_interrupted_pose() -> None:
    whole, book = session(world({"turn_z_deg": 2.0}))
    misalignment(whole, dwell_s=0.1, most_rounds=2)
    for interrupted_at in (0, 3, 6, 17, 37):
        kept = book.dwells[:interrupted_at]
        rest, again = session(world({"turn_z_deg": 2.0}, seed=2), dwells=kept)
        misalignment(rest, dwell_s=0.1, most_rounds=2)
        assert again.dwells[:interrupted_at] == kept
        assert [d.pose for d in again.dwells] == [d.pose for d in book.dwells]


def test_unusable_settings_and_channels_are_refused() -> None:
    rig, _ = session(world({}))
    with pytest.raises(SettingError, match="target_deg"):
        misalignment(rig, target_deg=0.0)
    with pytest.raises(ProcedureError, match="the adc has no channel vx"):
        extremes([Dwell(pose, 0.0, {"supply": 5.0}, {}, 1) for pose in coarse_poses()])
