from __future__ import annotations

import numpy as np
import pytest

from drivers.world.config import WorldConfig
from drivers.world.world import World
from tests.hidden.defects import DEFECTS, UNEXPLAINED, Defect

ALL = {**DEFECTS, **UNEXPLAINED}
TURN = np.concatenate([np.arange(0.0, 361.0, 30.0), np.arange(360.0, -1.0, -30.0)])


def swept(config: WorldConfig, seed: int = 2) -> np.ndarray:
    """Voltages (poses, 2) of three turns in a room whose temperature swings, over an hour."""
    room = {"ambient_cycle_k": 2.0, "ambient_cycle_s": 1000.0, "chamber_lag_s": 0.0}
    world = World(config.changed({"heat": room, "spread": {"imperfection_fraction": 0.0}}), seed)
    table = world.dwell_mean(np.repeat([90.0, 45.0, 135.0], len(TURN)), np.tile(TURN, 3), dwell_s=50.0, noise_free=True)
    return np.column_stack([table["vx_v"], table["vy_v"]])


@pytest.mark.parametrize("name", ALL)
def test_every_defect_shows_and_grows_with_its_size(name: str) -> None:
    defect = ALL[name]
    none, half, full = (swept(WorldConfig.ideal().changed(defect.settings(size))) for size in (0.0, 0.5, 1.0))
    changes = [np.abs(each - none).max() for each in (half, full)]
    assert changes[1] > 50e-6
    assert 1.2 < changes[1] / changes[0] < 3.5


@pytest.mark.parametrize("name", ALL)
def test_a_defect_of_size_zero_is_none(name: str) -> None:
    assert swept(WorldConfig.ideal().changed(ALL[name].settings(0.0))) == pytest.approx(
        swept(WorldConfig.ideal()), abs=1e-4
    )


def test_a_star_stands_for_both_axes() -> None:
    defect = Defect("", {"sensor.*.plates.gap_um": 2.0}, {"heat.ambient_c": 20.0})
    assert defect.settings(0.5, y_share=-1.0) == {
        "sensor": {"x": {"plates": {"gap_um": 1.0}}, "y": {"plates": {"gap_um": -1.0}}},
        "heat": {"ambient_c": 20.0},
    }


def test_charge_arrives_at_one_moment() -> None:
    change = swept(WorldConfig.ideal().changed(UNEXPLAINED["charge step"].settings(1.0))) - swept(WorldConfig.ideal())
    steps = np.abs(np.diff(change[:, 0]))
    assert (steps > 1e-5).sum() in (1, 2)  # a dwell across the moment has a part of it


def test_a_cable_tugs_in_its_sector_only() -> None:
    change = swept(WorldConfig.ideal().changed(UNEXPLAINED["cable tug"].settings(1.0))) - swept(WorldConfig.ideal())
    beta = np.tile(TURN, 3)
    inside = np.abs(beta - 200.0) < 25.0
    assert np.abs(change[inside]).min() > 1e-5
    assert np.abs(change[~inside]).max() < 1e-9


def test_a_mount_rocks_with_hysteresis() -> None:
    change = swept(WorldConfig.ideal().changed(UNEXPLAINED["rocking mount"].settings(1.0))) - swept(WorldConfig.ideal())
    assert len(np.unique(np.round(change[:, 0], 9))) == 2
    first = change[: len(TURN), 0].reshape(2, -1)
    assert not np.array_equal(first[0], first[1][::-1])
