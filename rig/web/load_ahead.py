"""What the first analysis of a server would wait for, done before: the machine code of a fit is loaded."""

from __future__ import annotations

import numpy as np

from calibrations.discovery.rows import Rows
from calibrations.model.file import read_model
from calibrations.table import Table

POSES = 36


def load_ahead() -> None:
    """Fit and compare a few poses of an ideal sensor: that loads the compiled loops, and compiles them where needed."""
    data = Rows(_sweep())
    data.compare(data.fit_without_outliers(read_model("linear"))[1].model)


def _sweep() -> Table:
    """Three turns of a sensor of 1 V/g with a pattern in place of noise."""
    alpha_deg, beta_deg = np.repeat([90.0, 30.0, 150.0], POSES // 3), np.tile(np.arange(0.0, 360.0, 30.0), 3)
    load, turn = np.sin(np.radians(alpha_deg)), np.radians(beta_deg)
    pattern = 1e-5 * np.cos(np.arange(POSES) ** 2)
    columns = {
        "alpha_deg": alpha_deg,
        "beta_deg": beta_deg,
        "direction": np.ones(POSES),
        "vx_v": 2.5 + load * np.cos(turn) + pattern,
        "vy_v": 2.5 + load * np.sin(turn) - pattern,
        "vx_std_v": np.full(POSES, 1e-3),
        "vy_std_v": np.full(POSES, 1e-3),
        "n": np.full(POSES, 1000.0),
        "t_s": 10.0 * np.arange(POSES),
    }
    return Table.from_columns("poses", columns, {"filter_corner_hz": 15.0, "sample_rate_hz": 1000.0}, "ideal")
