"""Bias and scale factor of each axis from tumbles, and their coefficients over a cycle of temperature.

A tumble has the four positions of beta at alpha = 90 deg, each reached from below and from above:

    V = B + SF a_x + C a_y      least squares over one tumble, C the cross-axis term; hysteresis is in the scatter

Over a cycle of temperature the slope and the difference between up and down follow from the tumbles:

    y = y0 + k (T - T0) + h s [+ d t]     s = 1/2 on the way up, the top included, -1/2 on the way down

d is drift, separable from hysteresis only with more than one cycle. The residual of a straight line (curvature, slow
noise) widens the standard errors, with few steps by Student's t. If the noise of the tumbles is not known (all samples
of each mean are equal), the standard errors follow from the residual alone.

Source  IEEE 1293, four-point tumble, temperature sensitivity; JCGM 101, 6.4.9: the standard uncertainty of a
        t-distribution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrations.errors import DataError
from calibrations.estimators.least_squares import least_squares
from calibrations.means.noise import rms, white_std
from calibrations.table import Array, Table

Rows = NDArray[np.intp]
OWN_COLUMN = {"x": 0, "y": 1}
QUARTER_DEG = 90.0


@dataclass(frozen=True)
class Tumble:
    """One tumble of one axis; standard errors are those of white noise, that of the scale factor is relative."""

    path: str
    t_s: float
    temperature_c: float
    bias_v: float
    scale_v_per_g: float
    bias_std_v: float
    scale_std: float


def estimate_tumbles(table: Table, axis: str) -> list[Tumble]:
    """All complete tumbles in order of time. Raises DataError if none is complete.

    A tumble with a missing pose is not used: hysteresis cancels only if each position was reached from both sides.
    """
    paths = np.array(table.labels.get("path", ()))
    rows_by_name = {name: np.flatnonzero(paths == name) for name in dict.fromkeys(paths.tolist()) if " " in name}
    if not rows_by_name:
        raise DataError(f"{table.source}: no tumble is complete yet; resume the run")
    missing = {name: _find_missing_position(table, rows) for name, rows in rows_by_name.items()}
    if all(missing.values()):
        name, missing_words = next(iter(missing.items()))
        raise DataError(f"{table.source}: no tumble is complete: {name!r} lacks {missing_words}; measure it again")
    return [_tumble(table, axis, name, rows) for name, rows in rows_by_name.items() if not missing[name]]


def _find_missing_position(table: Table, rows: Rows) -> str:
    """The first missing position of a tumble, "" for a complete one."""
    set_deg = table.column("beta_set_deg" if "beta_set_deg" in table else "beta_deg")
    quarters = np.round(set_deg[rows] / QUARTER_DEG) % 4
    directions = table.optional("direction", 0.0)[rows]
    positions = set(zip(quarters.tolist(), directions.tolist(), strict=True))
    for direction in sorted(set(directions.tolist()), reverse=True) or [0.0]:
        for quarter in range(4):
            if (float(quarter), direction) not in positions:
                side = {1.0: ", reached from below", -1.0: ", reached from above"}.get(direction, "")
                return f"beta {quarter * QUARTER_DEG:g} deg{side}"
    return ""


def _tumble(table: Table, axis: str, path: str, rows: Rows) -> Tumble:
    volts, beta = table.output(axis)[rows], np.radians(table.column("beta_deg")[rows])
    columns = np.column_stack([np.cos(beta), np.sin(beta), np.ones(len(beta))])
    white = white_std(table)
    noise = 0.0 if white is None else float(rms(white[rows, table.axes.index(axis)]))
    solution = least_squares(columns, volts)  # equal weights, so that hysteresis cancels
    std = noise * np.sqrt(np.diag(solution.covariance))
    scale = float(solution.values[OWN_COLUMN[axis]])
    temperature_c = table.optional("temperature_c", float("nan"))[rows]
    return Tumble(
        path,
        float(table.time_s[rows].mean()),
        float(temperature_c.mean()),
        float(solution.values[2]),
        scale,
        float(std[2]),
        float(std[OWN_COLUMN[axis]] / abs(scale)),
    )


# Coefficients over a cycle of temperature.

DIRECTIONS = {"up": 0.5, "down": -0.5}  # s of the formula, by the first word of the path


@dataclass(frozen=True)
class TemperatureCoefficients:
    """Slope per K, and up minus down, each (value, standard error): of a bias in V, of a scale factor as a fraction.

    A standard error is NaN if the noise is not known and no tumble is left to estimate it.
    """

    slope: tuple[float, float]
    hysteresis: tuple[float, float]


def bias_coefficients(steps: Sequence[Tumble]) -> TemperatureCoefficients:
    """Slope in V/K, hysteresis in V. Raises DataError without temperatures up and down."""
    return _fit_coefficients(steps, np.array([s.bias_v for s in steps]), np.array([s.bias_std_v for s in steps]))


def scale_coefficients(steps: Sequence[Tumble]) -> TemperatureCoefficients:
    """Slope in 1/K and hysteresis, as fractions of the mean scale factor. Raises DataError as `bias_coefficients`."""
    scale = np.array([s.scale_v_per_g for s in steps])
    return _fit_coefficients(steps, scale / scale.mean() - 1, np.array([s.scale_std for s in steps]))


def _fit_coefficients(steps: Sequence[Tumble], y: Array, std: Array) -> TemperatureCoefficients:
    temperature_c, t_s = (np.array([getattr(s, name) for s in steps]) for name in ("temperature_c", "t_s"))
    direction = np.array([DIRECTIONS[s.path.partition(" ")[0]] for s in steps])
    columns = np.column_stack([temperature_c - temperature_c.mean(), direction, np.ones(len(steps))])
    if len({s.path.rpartition(" ")[2] for s in steps}) > 1:
        columns = np.column_stack([columns, (t_s - t_s.mean()) / np.ptp(t_s)])
    free = len(steps) - columns.shape[1]
    if not np.isfinite(columns).all() or np.linalg.matrix_rank(columns) < columns.shape[1]:
        raise DataError("the cycle lacks different temperatures on the way up and down; use a bench with an oven")
    known = bool(np.any(std > 0))
    solution = least_squares(columns, y, np.where(std > 0, std, std.max()) ** 2 if known else 1.0)
    factors = solution.values
    excess = solution.square / max(free - 2, 1)
    variance = max(1.0, excess) if known else excess if free > 0 else np.nan
    widened = np.sqrt(np.diag(solution.covariance) * variance)
    return TemperatureCoefficients((float(factors[0]), float(widened[0])), (float(factors[1]), float(widened[1])))
