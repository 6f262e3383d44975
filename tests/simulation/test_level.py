"""The level on the turntable, against angles worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.world.config import WorldConfig
from drivers.world.stage import at_rest
from drivers.world.world import World

QUIET = {"level": {"noise_deg": 0.0}, "spread": {"imperfection_fraction": 0.0}}


def shown(alpha_deg: float, beta_deg: float, **changes: object) -> tuple[float, float]:
    world = World(WorldConfig.ideal().changed(QUIET | changes), seed=1)
    world.move_stage("alpha", at_rest(alpha_deg))
    world.move_stage("beta", at_rest(beta_deg))
    world.advance(1.0)
    return world.level_deg()


@pytest.mark.parametrize(
    ("alpha", "beta", "x", "y"),
    [
        (0.0, 37.0, 0.0, 0.0),
        (10.0, 0.0, 10.0, 0.0),
        (10.0, 90.0, 0.0, 10.0),
        (-10.0, 180.0, 10.0, 0.0),
        (10.0, 60.0, 5.0384, 8.6823),  # atan(tan(10) cos(60)), atan(tan(10) sin(60))
        (170.0, 0.0, 170.0, 180.0),  # upside down
    ],
)
def test_an_axis_shows_how_far_its_positive_end_is_up(alpha: float, beta: float, x: float, y: float) -> None:
    assert shown(alpha, beta) == pytest.approx((x, y), abs=1e-4)


def test_a_tilted_base_turns_with_the_table() -> None:
    base = {"tilt_x_deg": 0.3, "tilt_y_deg": -0.2}  # up is (sin -0.2, -sin 0.3, 1) to first order
    assert shown(0.0, 0.0, base=base) == pytest.approx((-0.2, -0.3), abs=1e-5)
    assert shown(0.0, 90.0, base=base) == pytest.approx((0.3, -0.2), abs=1e-5)


def test_the_stages_own_errors_are_seen() -> None:
    assert shown(0.0, 0.0, stages={"alpha": {"zero_offset_deg": 0.25}})[0] == pytest.approx(0.25)
    assert shown(0.0, 0.0, stages={"alpha": {"wobble_deg": 0.1, "wobble_phase_deg": -90.0}})[0] == pytest.approx(0.1)
    assert shown(1.0, 0.0, stages={"alpha": {"play_deg": 0.2}})[0] == pytest.approx(0.9)
    x, y = shown(5.0, 0.0, stages={"beta": {"zero_offset_deg": 2.0}})
    assert np.degrees(np.arctan2(np.tan(np.radians(y)), np.tan(np.radians(x)))) == pytest.approx(2.0)


def test_its_own_offset_is_not_the_plates() -> None:
    assert shown(1.0, 0.0, level={"offset_x_deg": 0.02, "offset_y_deg": -0.01, "noise_deg": 0.0}) == pytest.approx(
        (1.02, -0.01)
    )


def readings(world: World, n: int) -> np.ndarray:
    found = []
    for k in range(n):
        world.advance(0.05 * (k + 1))
        found.append(world.level_deg())
    return np.array(found)


def test_noise_is_white_of_the_size_that_was_set() -> None:
    noise = readings(World(WorldConfig.ideal(), seed=4), 1000)
    assert noise.std(axis=0) == pytest.approx([0.003, 0.003], rel=0.1)
    assert abs(np.corrcoef(noise[:-1, 0], noise[1:, 0])[0, 1]) < 0.1
    assert abs(np.corrcoef(noise.T)[0, 1]) < 0.1


def test_looking_at_it_disturbs_nothing() -> None:
    looked, left = (World(WorldConfig.adxl203(), seed=2) for _ in range(2))
    first = readings(looked, 20)
    left.advance(1.0)
    assert looked.state() == left.state()
    assert np.array_equal(first, readings(World(WorldConfig.adxl203(), seed=2), 20))
    assert not np.array_equal(first, readings(World(WorldConfig.adxl203(), seed=3), 20))
