"""Bias and scale factor of each axis from tumble tests: the four positions of beta at alpha = 90, up and down.

    V = B + SF a_x + C a_y      least squares over one tumble, C the cross-axis term; hysteresis is in the scatter

Source  IEEE 1293, four-point tumble.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrations.errors import DataError
from calibrations.estimators.least_squares import least_squares
from calibrations.noise import rms
from calibrations.noise_estimation.mean_noise import white_std
from calibrations.table import Table

Rows = NDArray[np.intp]
OWN = {"x": 0, "y": 1}
QUARTER_DEG = 90.0


@dataclass(frozen=True)
class Tumble:
    """One tumble of one axis; the standard errors are those of white noise, the scale factor's relative."""

    path: str
    t_s: float
    temperature_c: float
    bias_v: float
    scale_v_per_g: float
    bias_std_v: float
    scale_std: float


def tumbles(table: Table, axis: str) -> list[Tumble]:
    """Every complete tumble in the order of time. Raises DataError where there is none.

    One without a pose is left out: hysteresis drops out of four positions only where each was reached from both sides.
    """
    paths = np.array(table.labels.get("path", ()))
    begun = {name: np.flatnonzero(paths == name) for name in dict.fromkeys(paths.tolist()) if " " in name}
    if not begun:
        raise DataError(f"{table.source}: holds no tumble yet; resume the run")
    missing = {name: _missing(table, rows) for name, rows in begun.items()}
    if all(missing.values()):
        name, where = next(iter(missing.items()))
        raise DataError(f"{table.source}: no tumble is complete: {name!r} is without {where}; measure it again")
    return [_tumble(table, axis, name, rows) for name, rows in begun.items() if not missing[name]]


def _missing(table: Table, rows: Rows) -> str:
    """The first position that a tumble was not held in, "" where it is complete."""
    set_deg = table.column("beta_set_deg" if "beta_set_deg" in table else "beta_deg")
    quarters = np.round(set_deg[rows] / QUARTER_DEG) % 4
    directions = table.optional("direction", 0.0)[rows]
    held = set(zip(quarters.tolist(), directions.tolist(), strict=True))
    for direction in sorted(set(directions.tolist()), reverse=True) or [0.0]:
        for quarter in range(4):
            if (float(quarter), direction) not in held:
                side = {1.0: ", reached from below", -1.0: ", reached from above"}.get(direction, "")
                return f"beta {quarter * QUARTER_DEG:g} deg{side}"
    return ""


def _tumble(table: Table, axis: str, path: str, rows: Rows) -> Tumble:
    volts, beta = table.column(f"v{axis}_v")[rows], np.radians(table.column("beta_deg")[rows])
    columns = np.column_stack([np.cos(beta), np.sin(beta), np.ones(len(beta))])
    white = white_std(table)
    noise = 0.0 if white is None else float(rms(white[rows, table.axes.index(axis)]))
    found = least_squares(columns, volts)  # of equal weight: only so does hysteresis drop out
    std = noise * np.sqrt(np.diag(found.covariance))
    scale = float(found.values[OWN[axis]])
    temperature_c = table.optional("temperature_c", float("nan"))[rows]
    return Tumble(
        path,
        float(table.time_s[rows].mean()),
        float(temperature_c.mean()),
        float(found.values[2]),
        scale,
        float(std[2]),
        float(std[OWN[axis]] / abs(scale)),
    )
