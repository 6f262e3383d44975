"""The simulated magnetometer and gyroscope against what physics says of them, written out here."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from drivers.world.config import WorldConfig
from drivers.world.gravity import Base
from drivers.world.kernel import record
from drivers.world.laboratory import Iron, Laboratory, Magnet, field_ut, near_iron_ut, near_magnet_ut, rotation_deg_s
from drivers.world.stage import Trajectory
from drivers.world.world import World

SILENT = {"converter": {"noise_v": 0.0}, "magnetometer": {"noise_v": 0.0}, "gyroscope": {"noise_v": 0.0}}
FIELD, RATE = ("mx", "my", "mz"), ("gx", "gy", "gz")
EARTH = 0.00417807  # deg/s


def silent(**changes: Any) -> WorldConfig:
    return WorldConfig.ideal().changed(SILENT).changed(changes)


def volts(world: World, inputs: tuple[str, ...]) -> np.ndarray:
    return np.asarray(world.adc_volts(inputs, world.now_s + 0.2, 1e-3, 5).mean(axis=0))


def turning(world: World, axis: str, rate_deg_s: float, at_s: float) -> np.ndarray:
    """The gyroscope while a stage turns from where it stands, a while after it has begun."""
    start = world.motor_angle_deg(axis)
    way = Trajectory(world.now_s, start, start + np.sign(rate_deg_s) * 360.0, abs(rate_deg_s), 200.0)
    world.move_stage(axis, way)
    world.advance(world.now_s + at_s)
    found = np.asarray(world.adc_volts(RATE, world.now_s, 1e-3, 100).mean(axis=0))
    world.advance(way.end_s)
    return found


def test_the_field_of_a_magnet_is_that_of_a_dipole() -> None:
    """Twice as strong along its axis as beside it, and the other way round there; 1 mA m^2 at 10 mm: 200 uT."""
    along = near_magnet_ut(record(Magnet(x_mm=10.0, moment_x_ma_m2=1.0)))
    beside = near_magnet_ut(record(Magnet(x_mm=0.0, y_mm=10.0, moment_x_ma_m2=1.0)))
    assert along == pytest.approx((200.0, 0.0, 0.0))
    assert beside == pytest.approx((-100.0, 0.0, 0.0))


def test_a_ball_of_iron_strengthens_the_field_before_and_behind_it_and_weakens_it_at_its_sides() -> None:
    iron = record(Iron(x_mm=0.0, y_mm=20.0, radius_mm=10.0, permeability_ratio=1e9))
    assert near_iron_ut(iron, 0.0, 40.0, 0.0) == pytest.approx((0.0, 40.0 * (1 + 2 / 8), 0.0))
    assert near_iron_ut(iron, 40.0, 0.0, 0.0) == pytest.approx((40.0 * (1 - 1 / 8), 0.0, 0.0))
    assert near_iron_ut(record(Iron(radius_mm=10.0, permeability_ratio=1.0)), 1.0, 2.0, 3.0) == (1.0, 2.0, 3.0)


def test_the_earths_field_and_rotation_stand_as_the_base_does() -> None:
    """The base's x to the east: declination 0, so that the field's horizontal part is along its y, north."""
    east = Laboratory(latitude_deg=30.0, heading_deg=90.0, field_ut=50.0, dip_deg=60.0, declination_deg=0.0)
    assert field_ut(east, Base()) == pytest.approx([0.0, 25.0, -50.0 * np.sqrt(0.75)])
    assert rotation_deg_s(east, Base()) == pytest.approx([0.0, EARTH * np.sqrt(0.75), EARTH / 2], abs=1e-8)
    beside = Laboratory(magnet=Magnet(z_mm=0.0, x_mm=100.0, moment_x_ma_m2=10.0))
    assert field_ut(beside, Base()) - field_ut(Laboratory(), Base()) == pytest.approx([2.0, 0.0, 0.0])


def test_a_level_turn_is_a_circle_that_a_magnet_of_ones_own_moves_and_one_of_the_rig_does_not() -> None:
    def turn(**changes: Any) -> np.ndarray:
        world = World(silent(**changes), seed=1)
        return np.array([_at(world, beta) for beta in (0.0, 90.0, 180.0, 270.0)])

    def _at(world: World, beta: float) -> np.ndarray:
        way = Trajectory(world.now_s, world.motor_angle_deg("beta"), beta, 90.0, 300.0)
        world.move_stage("beta", way)
        world.advance(way.end_s)
        return volts(world, FIELD)

    magnet = {"x_mm": 30.0, "moment_x_ma_m2": 1.0}
    alone, own, rig = turn(), turn(magnetometer={"magnet": magnet}), turn(laboratory={"magnet": magnet})
    assert alone[:, :2].mean(axis=0) == pytest.approx([0.0, 0.0], abs=1e-9)
    assert (own - alone) == pytest.approx(np.tile([0.02 * 200.0 / 27.0, 0.0, 0.0], (4, 1)), abs=1e-9)
    assert rig[:, :2].mean(axis=0) == pytest.approx([0.0, 0.0], abs=1e-9)
    size = np.linalg.norm(rig[:, :2], axis=1)
    assert size == pytest.approx(size[0])
    assert alone[1, :2] == pytest.approx([-alone[0, 1], alone[0, 0]])  # it went round as the specific force would


@pytest.mark.parametrize(("up", "axis"), [("x", 0), ("y", 1), ("z", 2)])
@pytest.mark.parametrize("flip", [0, 1])
def test_a_turn_of_beta_is_a_rate_about_the_edge_that_stands_along_its_axis(up: str, axis: int, flip: int) -> None:
    world = World(silent(laboratory={"latitude_deg": 0.0}), seed=1)
    at_rest = volts(world, RATE)
    world.mount_sensor(0.0, flip, up)
    changed = turning(world, "beta", 50.0, at_s=1.0) - at_rest
    expected = np.zeros(3)
    expected[axis] = -50.0 * (-1 if flip else 1)  # beta grows clockwise
    per_deg_s = abs(changed[axis]) / 50.0
    assert per_deg_s == pytest.approx(6e-3, rel=0.02)
    assert changed / per_deg_s == pytest.approx(expected, abs=0.02)


def test_a_turn_of_alpha_is_a_rate_about_the_base_y_axis() -> None:
    world = World(silent(), seed=1)
    at_rest = volts(world, RATE)
    assert np.argmax(np.abs(turning(world, "alpha", 40.0, at_s=1.0) - at_rest)) == 1


def test_at_rest_a_gyroscope_feels_the_earth_turn() -> None:
    pole, equator = (
        volts(World(silent(laboratory={"latitude_deg": latitude}), seed=1), RATE) for latitude in (90.0, 0.0)
    )
    assert (pole - equator)[2] / 6.05e-3 == pytest.approx(EARTH, rel=0.01)


def test_unbalanced_masses_feel_gravity_by_their_quadrature_alone() -> None:
    """Through a perfect demodulator nothing of it comes."""

    def by_gravity(**tines: float) -> float:
        """What the face up and the face down differ by; the masses of y are pushed along z."""
        world = World(silent(gyroscope={"y": tines}, laboratory={"latitude_deg": 90.0}), seed=1)
        up = volts(world, RATE)[1]
        world.mount_sensor(0.0, 1)
        return float(up - volts(world, RATE)[1])

    uneven = {"unbalance_fraction": 0.02, "off_square_per_nm": 40.0}
    assert by_gravity(**uneven) == pytest.approx(0.0, abs=1e-9)
    assert abs(by_gravity(**uneven, demodulator_deg=5.0)) > 1e-4
    assert by_gravity(off_square_ppm=2.0, demodulator_deg=5.0) == pytest.approx(0.0, abs=1e-9)


def test_without_power_there_is_nothing() -> None:
    world = World(silent(), seed=1)
    world.power(False)
    world.advance(1.0)
    assert volts(world, (*FIELD, *RATE)) == pytest.approx(np.zeros(6))
