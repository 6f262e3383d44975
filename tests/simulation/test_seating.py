"""Mountings: each is a new one, settled by time and seed; none differs on an ideal rig."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.world.accelerometer import per_g_nm
from drivers.world.config import WorldConfig
from drivers.world.gravity import Seating, rotation, seat_mounting
from drivers.world.world import World

LOOSE = {"seating": {"grip_pm": 20.0}, "spread": {"imperfection_fraction": 0.0}, "noise": {"white_v": 0.0}}


def test_mountings_scatter_as_they_are_set_to() -> None:
    drawn = [seat_mounting(Seating(0.02, 5.0), seed, 0, 10**9) for seed in range(400)]
    tilts_deg = np.degrees([[r[2, 1], -r[2, 0], r[1, 0]] for r, _ in drawn])
    assert tilts_deg.std() == pytest.approx(0.02, rel=0.05)
    assert np.std([grip for _, grip in drawn]) == pytest.approx(5e-3, rel=0.06)


def test_one_plate_with_a_clamp_for_each_sensor() -> None:
    (first, grip), (second, other) = (seat_mounting(Seating(0.02, 5.0), 1, place, 10**9) for place in (0, 1))
    np.testing.assert_array_equal(first, second)
    assert (grip != other).all()
    again, same = seat_mounting(Seating(0.02, 5.0), 1, 0, 10**9)
    np.testing.assert_array_equal(again, first)
    np.testing.assert_array_equal(same, grip)


def test_an_ideal_rig_mounts_alike() -> None:
    tilt, grip_nm = seat_mounting(Seating(), 1, 0, 5)
    np.testing.assert_array_equal(tilt, rotation(0, 0, 0))
    np.testing.assert_array_equal(grip_nm, 0)


def test_a_grip_shifts_the_output_and_a_restored_world_keeps_it() -> None:
    config = WorldConfig.ideal().changed(LOOSE)
    world = World(config, seed=1)
    before = world.adc_volts(("vx", "vy"), 1.0, 1e-3, 1)
    world.mount_sensor()
    after = world.adc_volts(("vx", "vy"), 3.0, 1e-3, 1)
    _, grip_nm = seat_mounting(config.seating, 1, 0, 10**9)
    np.testing.assert_allclose(after - before, [grip_nm / per_g_nm(5500.0)], rtol=0.05)
    other = World(config, seed=1)
    other.restore(world.state())
    np.testing.assert_array_equal(other.adc_volts(("vx",), 4.0, 1e-3, 5), world.adc_volts(("vx",), 4.0, 1e-3, 5))
