from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.world.stage import PIECES, Trajectory, at_rest, motion, motor_angle_deg

angles = st.floats(-400, 400)


@given(start=angles, target=angles, stop=st.none() | st.floats(0, 60), speed=st.floats(1, 50))
def test_pieces_follow_the_trajectory(start: float, target: float, stop: float | None, speed: float) -> None:
    move = Trajectory(2.0, start, target, speed, 2 * speed)
    if stop is not None:
        move = move.stopped(stop)
    table = motion(move)
    assert table.shape == (PIECES, 4)
    for t in np.linspace(0.0, move.end_s + 1, 40):
        assert motor_angle_deg(table, t) == pytest.approx(move.angle_deg(t), abs=1e-6)


def test_a_stage_at_rest_stays() -> None:
    assert motor_angle_deg(motion(at_rest(33.0)), 1e5) == 33.0


def test_a_short_move_has_no_cruise() -> None:
    assert len(Trajectory(0.0, 0.0, 0.1, 20.0, 40.0).pieces()) == 3
