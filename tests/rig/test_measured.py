"""Attitudes and forces in tables of runs, against the simulated rig, which computes them on its own."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.recorder import Samples
from drivers.world.gravity import Base, Package, felt_g, mounting, vertical
from procedures.session import Pose
from rig.record.measured import FORCE, positions_table, sensor_from_base, sensor_from_table, specific_force_g
from rig.record.values import KeptPose, Run

ANGLES = st.floats(-360.0, 360.0)
POSES = st.builds(Pose, ANGLES, ANGLES, mount_deg=ANGLES, flip=st.sampled_from([0, 1]), up=st.sampled_from("xyz"))


@given(pose=POSES)
def test_the_force_on_a_sensor_at_rest_is_that_of_the_simulated_rig(pose: Pose) -> None:
    mount = mounting(Package(), pose.mount_deg, pose.flip, pose.up)
    force = felt_g(vertical(Base()), mount, math.radians(pose.alpha_deg), math.radians(pose.beta_deg))
    assert sensor_from_table(pose) == pytest.approx(mount, abs=1e-12)
    assert specific_force_g(pose) == pytest.approx(force, abs=1e-11)
    assert sensor_from_base(pose) @ sensor_from_base(pose).T == pytest.approx(np.eye(3), abs=1e-12)


@given(pose=POSES)
def test_the_force_of_a_turn_is_the_mean_over_the_turn(pose: Pose) -> None:
    turn = Pose(**{**pose.__dict__, "rate_deg_s": 20.0})
    stops = [Pose(**{**pose.__dict__, "beta_deg": pose.beta_deg + k * 45.0}) for k in range(8)]
    mean = np.mean([specific_force_g(stop) for stop in stops], axis=0)
    assert specific_force_g(turn) == pytest.approx(mean, abs=1e-11)


def test_one_position_makes_a_table() -> None:
    samples = Samples(np.array([[0.1, 0.2, 1.0], [0.3, 0.2, 1.0]]), FORCE, 1000.0, 2.5)
    run = Run("a", "positions", "hand", "running", {}, {}, {}, "", {}, "", "", None, None, {}, 1)
    table = positions_table(run, [KeptPose(Pose(0.0, 0.0), samples, 3.5, None)])
    assert [table.column(name).tolist() for name in FORCE] == [pytest.approx([0.2]), [0.2], [1.0]]
