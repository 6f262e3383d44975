"""Smooth columns: what any static sensor could do, and no more columns than the rows allow."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.geometry.smooth import ROWS_PER_COLUMN, smooth_columns
from calibrations.table import Array, Table
from tests.calibrations import synthetic


def table(inclinations: tuple[float, ...] = (90, 30, 150, 60, 120), step_deg: float = 10.0) -> Table:
    columns = synthetic.turns(inclinations, step_deg)
    return synthetic.poses(columns, columns["beta_deg"], columns["beta_deg"])


def left(smooth: Array, y: Array) -> float:
    """Share of `y` that the columns do not hold."""
    return float(np.linalg.norm(y - smooth @ (smooth.T @ y)) / np.linalg.norm(y))


def test_holds_every_smooth_law_of_gravity_and_its_side() -> None:
    data = table()
    smooth = smooth_columns(data)
    a_x, a_y, a_z = synthetic.components(dict(data.columns))
    side = data.column("direction")
    np.testing.assert_allclose(smooth.T @ smooth, np.eye(smooth.shape[1]), atol=1e-12)
    for law in (np.ones(data.n), a_z**2 * a_x, a_x**3 * a_y**2, a_x**5, side, side * a_y, side * a_x * a_y * a_z):
        assert left(smooth, law) < 1e-10
    assert left(smooth, np.random.default_rng(0).standard_normal(data.n)) > 0.85  # noise is none


@pytest.mark.parametrize("inclinations", [(90,), (90, 30), (90, 30, 150, 60, 120)])
@pytest.mark.parametrize("step_deg", [10.0, 30.0, 90.0])
def test_smooth_columns_leave_enough_rows(inclinations: tuple[float, ...], step_deg: float) -> None:
    data = table(inclinations, step_deg)
    assert smooth_columns(data).shape[1] <= data.n / ROWS_PER_COLUMN


def test_unknown_orientations_have_none() -> None:
    positions = Table.from_columns("positions", dict.fromkeys(("ax", "ay", "az"), np.arange(50.0)))
    assert smooth_columns(positions).shape == (50, 0)
