"""Compensated, a simulated sensor errs far less on unseen poses than by the manufacturer's formula (Ang Fig. 12)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calibrations.compensation.inverse import Compensation, compensate_residual, invert_model
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit
from calibrations.geometry.orientation import nominal_pose, specific_force
from calibrations.means.noise import rms
from calibrations.model.file import read_model
from calibrations.presentation.charts.motion import compensated_chart
from calibrations.presentation.static import save
from calibrations.table import Array, Table
from drivers.world.config import WorldConfig
from drivers.world.world import World

CONSTANTS = {"sample_rate_hz": 1000.0, "filter_corner_hz": 15.07}
FAULTY = WorldConfig.ideal().changed(
    {
        "sensor": {
            "package": {"turn_x_deg": 0.5, "turn_y_deg": -0.3, "turn_z_deg": 0.4},
            "x": {"plates": {"plate_mismatch_fraction": 0.3}, "springs": {"stress_pm_per_k": 5}},
            "y": {"plates": {"plate_mismatch_fraction": -0.4}, "springs": {"stress_pm_per_k": -4}},
        },
        "spread": {"imperfection_fraction": 0.0},
        "heat": {"ambient_cycle_k": 2.5, "ambient_cycle_s": 2300.0, "chamber_lag_s": 60.0},
    }
)


def turned(world: World, inclinations_deg: tuple[float, ...], step_deg: float) -> Table:
    """A turn each way at each inclination."""
    up = np.arange(0.0, 361.0, step_deg)
    alpha = np.repeat(inclinations_deg, 2 * len(up))
    beta = np.tile(np.concatenate([up, up[::-1]]), len(inclinations_deg))
    direction = np.tile(np.repeat([1, -1], len(up)), len(inclinations_deg))
    return Table.from_columns("poses", world.dwell_mean(alpha, beta, direction=direction), CONSTANTS, "simulated")


@pytest.mark.slow
def test_the_error_on_unseen_poses_falls_to_a_fiftieth(tmp_path: Path) -> None:
    world = World(FAULTY, seed=7)
    seen = turned(world, (90.0, 30.0, 150.0, 60.0), 30.0)
    model = read_model("linear")
    for name in ("axis-misalignment", "quadratic-nonlinearity", "temperature-bias"):
        model = model.with_effect(catalogue()[name])
    unseen = turned(world, (120.0, 70.0, 40.0), 20.0)
    left = compensate_residual(invert_model(fit(model, seen).model), unseen)
    for linear, compensated_ in left.rmse.values():
        assert 30 < linear < 100  # mm/s^2
        assert compensated_ < linear / 50
    save(compensated_chart(left), tmp_path / "residual.png")
    assert (tmp_path / "residual.png").stat().st_size > 10_000


RUBBING = {"friction": {"stiffness_fraction": 0.0035, "slip_nm": 3.3, "pressing_per_g2": 0.5}}
SLIPPING = WorldConfig.ideal().changed(
    {"sensor": {"x": RUBBING, "y": RUBBING}, "spread": {"imperfection_fraction": 0.0}}
)


def streamed(made: Compensation, table: Table) -> Array:
    """What a product finds that is given one row after the other, g, shape (n, 2)."""
    found, remembered = [], {}
    for vx, vy in table.outputs:
        out = made.program.run({"vx": vx, "vy": vy} | remembered)
        remembered = {name: out[name] for name in made.forward.memory}
        found.append([out["ax"], out["ay"]])
    return np.array(found, float)


def test_hysteresis_that_is_remembered_errs_a_fifth_of_that_which_is_left_out() -> None:
    world = World(SLIPPING, seed=7)
    slips = read_model("linear").with_effect(catalogue()["hysteresis"])
    fitted = fit(slips, turned(world, (90.0, 30.0, 150.0, 60.0), 30.0)).model
    unseen = turned(world, (120.0, 70.0, 40.0), 10.0)
    true = specific_force(nominal_pose(unseen))[:, :2]
    left_out, remembered = (
        1e3 * rms((streamed(invert_model(fitted, without=without), unseen) - true).T)
        for without in (["hysteresis"], [])
    )
    assert (left_out > 3).all()  # mg
    assert (remembered < left_out / 5).all()
    for linear, compensated_ in compensate_residual(invert_model(fitted), unseen).rmse.values():
        assert compensated_ < linear / 4
