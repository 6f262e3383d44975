"""A stage's scale that is off by half a percent, and a sensor's nonlinearity that resembles it."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.discovery.plausibility import refusal, rejection
from calibrations.fitting.fit import fit
from calibrations.geometry.orientation import nominal_pose, specific_force
from calibrations.model.file import read_model
from calibrations.table import Array, Table

ALPHA_DEG, BETA_DEG = (a.ravel() for a in np.meshgrid([90, 30, 150, 60, 120, 45, 75], np.arange(0.0, 361, 10)))
NOISE_V = 5e-5


def table(alpha_deg: Array, scale_over_z: float) -> Table:
    """Poses that the stages state as `ALPHA_DEG`, of a sensor that stands at `alpha_deg`."""
    angles = {"alpha_deg": ALPHA_DEG, "beta_deg": BETA_DEG}
    stated = {**angles, "vx_v": BETA_DEG, "vy_v": BETA_DEG, "t_s": 8.0 * np.arange(len(BETA_DEG))}
    force = specific_force(nominal_pose(Table.from_columns("poses", {**stated, "alpha_deg": alpha_deg})))
    z = force[:, 2]
    outputs = 2.5 + force[:, :2] * (1 + scale_over_z * (z**2 + 0.3 * z))[:, None]
    outputs += np.random.default_rng(1).normal(0, NOISE_V, outputs.shape)
    scatter = {name: np.full(len(z), NOISE_V * np.sqrt(100)) for name in ("vx_std_v", "vy_std_v")}
    columns = {**stated, "vx_v": outputs[:, 0], "vy_v": outputs[:, 1], **scatter, "n": np.full(len(z), 100.0)}
    return Table.from_columns("poses", columns)


@pytest.mark.parametrize("scale", [0.99, 1.005])
def test_a_scale_of_a_stage_that_is_off_is_named(scale: float) -> None:
    found = rejection(fit(read_model("linear"), table(scale * ALPHA_DEG, 0.0)))
    assert found is not None
    assert f"alpha_deg is multiplied by {1 * scale:.3f}"[:29] in found.text


@pytest.mark.parametrize("size", [-0.012, 0.008])
def test_a_scale_factor_over_the_third_axis_is_no_scale_of_a_stage(size: float) -> None:
    assert rejection(fit(read_model("linear"), table(ALPHA_DEG, size))) is None


@pytest.mark.parametrize("turns", [3, 20])
def test_the_row_is_named_at_which_a_sensor_moved_on_its_mount(turns: int) -> None:
    short = table(ALPHA_DEG, 0.0)
    columns = {name: np.tile(values, turns) for name, values in short.columns.items()}
    columns["t_s"] = 8.0 * np.arange(turns * short.n)
    row = turns * short.n * 2 // 3 + 5
    columns["vx_v"][row:] = 2.5 + 0.8 * (columns["vx_v"][row:] - 2.5) + 0.3 * (columns["vy_v"][row:] - 2.5)
    moved = Table.from_columns("poses", columns)
    found = refusal(moved)
    assert found is not None
    assert f"the rows from #{row} on" in found.text
