from __future__ import annotations

from math import degrees

import pytest

from drivers.world.kernel import record
from drivers.world.stage import Stage, engaged_deg, true_angle_rad


def true_deg(stage: Stage, table_deg: float) -> float:
    return degrees(true_angle_rad(record(stage), table_deg))


def test_a_perfect_stage_points_where_its_motor_does() -> None:
    assert true_deg(Stage(), 123.0) == pytest.approx(123.0)


def test_zero_offset_shifts_every_angle() -> None:
    assert true_deg(Stage(zero_offset_deg=0.2), -40.0) == pytest.approx(-39.8)


def test_wobble_is_one_cycle_per_turn() -> None:
    stage = Stage(wobble_deg=0.1, wobble_phase_deg=30.0)
    assert true_deg(stage, 30.0) == pytest.approx(30.0)
    assert true_deg(stage, 120.0) == pytest.approx(120.1)
    assert true_deg(stage, 300.0) == pytest.approx(299.9)


def test_a_worm_errs_five_times_a_turn() -> None:
    stage = Stage(worm_deg=0.1)
    assert true_deg(stage, 18.0) == pytest.approx(18.1)
    assert true_deg(stage, 18.0 + 72.0) == pytest.approx(90.1)


def test_gear_play_lags_by_half_in_each_direction() -> None:
    stage = record(Stage(play_deg=0.2))
    table = 0.0
    for motor in range(11):
        table = engaged_deg(stage, table, motor)
    assert table == pytest.approx(9.9)
    assert engaged_deg(stage, table, 9.85) == pytest.approx(9.9)  # inside the play nothing moves
    assert engaged_deg(stage, table, 5.0) == pytest.approx(5.1)
