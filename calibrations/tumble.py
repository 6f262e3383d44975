"""Bias and scale factor of each axis from tumble tests: the four positions of beta at alpha = 90, up and down.

    V = B + SF a_x + C a_y      least squares over one tumble, C the cross-axis term; hysteresis is in the scatter

Source  IEEE 1293, four-point tumble.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrations.errors import DataError
from calibrations.mean_noise import white_std
from calibrations.table import Table

Rows = NDArray[np.intp]
OWN = {"x": 0, "y": 1}


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
    """Every complete tumble in the order of time. Raises DataError where there is none."""
    paths = np.array(table.labels.get("path", ()))
    found = [
        _tumble(table, axis, name, np.flatnonzero(paths == name))
        for name in dict.fromkeys(paths.tolist())
        if " " in name
    ]
    if not found:
        raise DataError(f"{table.source}: holds no tumble yet; resume the run")
    return found


def _tumble(table: Table, axis: str, path: str, rows: Rows) -> Tumble:
    volts, beta = table.column(f"v{axis}_v")[rows], np.radians(table.column("beta_deg")[rows])
    columns = np.column_stack([np.cos(beta), np.sin(beta), np.ones(len(beta))])
    if np.linalg.matrix_rank(columns) < 3:
        raise DataError(f"{table.source}: the tumble {path!r} is not complete; resume the run")
    inverse = np.linalg.pinv(columns)
    factors = inverse @ volts
    white = white_std(table)
    noise = np.zeros(len(rows)) if white is None else white[rows, table.axes.index(axis)]
    std = np.sqrt((inverse * noise) ** 2 @ np.ones(len(rows)))
    scale = float(factors[OWN[axis]])
    temperature_c = table.optional("temperature_c", float("nan"))[rows]
    return Tumble(
        path,
        float(table.time_s[rows].mean()),
        float(temperature_c.mean()),
        float(factors[2]),
        scale,
        float(std[2]),
        float(std[OWN[axis]] / abs(scale)),
    )
